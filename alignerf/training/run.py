"""A running training: its state, and what the loop does between steps.

`loop.run_steps` makes the steps. A `Run` fetches the steps' numbers, saves
checkpoints in a thread, and calls the aligner for photos and cameras.
"""

import concurrent.futures
import dataclasses
import time
from typing import Any

import jax
import numpy as np

from alignerf.experiment import jobs
from alignerf.processes import devices
from alignerf.training import checkpoint, diagnose, memory, program

# A training diverges where of so many looks at its loss, and all since the last
# checkpoint, each is so many times that of the start: batches differ by less. What
# fine-tuning starts from is trained, and new rates may cost it some decibels at first.
MIN_LOOKS, WORSE, WORSE_TUNED = 10, 1.25, 4.0


@dataclasses.dataclass
class Run:
    """A running training: inputs of its steps, its state, and its numbers so far."""

    job: jobs.Job
    method: Any
    program: program.Program
    checkpoints: str
    identity: str
    aligner: Any
    names: list  # of the views
    unaligned: Any  # the views before any alignment
    facts: dict  # entries of timing.json that are known before the first step
    state: Any
    views: Any  # after the alignments so far, on the devices
    numbers: dict  # loss, PSNR and others: means over the last steps
    spent_s: float  # seconds of earlier processes, from the checkpoint
    aside: tuple | None = None  # the other method and program, see `switch`
    started_s: float = dataclasses.field(default_factory=time.perf_counter)
    losses: list = dataclasses.field(default_factory=list)  # since the last checkpoint
    # Writes checkpoints; `saving` is the one that it writes.
    writer: Any = dataclasses.field(
        default_factory=lambda: concurrent.futures.ThreadPoolExecutor(1)
    )
    saving: Any = None

    def time_s(self):
        """Seconds of all steps, alignments and saves so far, without compilation."""
        passed_s = time.perf_counter() - self.started_s - self.aligner.compile_time_s
        return round(self.spent_s + passed_s, 3)

    def save(self):
        """Begin to write a checkpoint, once the one before is written.

        ValueError where the parameters are not finite, or the loss has risen: the two
        checkpoints before stay.
        """
        check_finite(self.state)
        self.check_loss()
        self.wait()
        facts = {"identity": self.identity, "time_s": self.time_s()}
        # Of both programs that of the first, with which a run begins anew.
        first = self.aside[1] if self.aligner.learning else self.program
        facts |= {"micro_batches": first.micro_batches, "final": self.numbers}
        # The next step takes the state's own memory.
        state = jax.tree.map(np.array, jax.device_get(self.state))
        save = checkpoint.save
        self.saving = self.writer.submit(save, self.checkpoints, state, **facts)

    def wait(self):
        """Wait until the last checkpoint is written; raises what its writing has."""
        if self.saving:
            self.saving.result()

    def check_loss(self):
        """ValueError where the loss stays above that of the start."""
        if len(self.losses) < MIN_LOOKS:
            return
        least, first = min(self.losses), self.numbers["first_loss"]
        if least > first * (WORSE_TUNED if self.job.stage == "finetune" else WORSE):
            raise ValueError(
                f"training diverges before step {int(self.state.step)}: its loss, "
                f"{first:.3g} at the start, stays above {least:.3g}; lower "
                "learning_rates"
            )
        self.losses.clear()

    def align(self):
        """Align cameras and photos, and replace the views by the aligned ones."""
        learning = self.aligner.learning
        changed = self.aligner.align(self.state.params, int(self.state.step))
        if changed is not None:
            changed = devices.place(changed, self.program.mesh)
            self.state = self.state._replace(params=changed)
        if self.aligner.learning != learning:
            self.switch()
        views = self.aligner.views(self.unaligned)
        self.views = devices.place(views, self.program.mesh)

    def switch(self):
        """Go on by the program that learns besides, or back by the first one."""
        begun, aside = time.perf_counter(), (self.method, self.program)
        self.method, self.program = self.aside or self.learning()
        self.aside = aside
        # Compiling is counted apart.
        self.started_s += time.perf_counter() - begun

    def learning(self):
        """(method, program) that learn besides, as cameras."""
        method, parts = self.aligner.learning_method(), self.program.micro_batches
        shapes = jax.eval_shape(lambda *both: both, self.state.params, self.views)
        # Adam's moments are there already.
        there = memory.tree_bytes(self.state.optimizer)
        built = program.build(
            self.job, method, *shapes, micro_batches=parts, to_come=-there
        )
        return method, built

    def look(self, stats):
        """Fetch the numbers of some steps, and keep their means.

        stats: a dict of device arrays for each step. Raises ValueError where a step is
        not finite.
        """
        numbers = jax.device_get(stats)
        if not all(map(is_finite, numbers)):
            raise ValueError(self.explain())
        means = {
            key: float(np.mean([step[key] for step in numbers])) for key in numbers[0]
        }
        first = self.numbers.get("first_loss", means["loss"])
        self.numbers = means | {"first_loss": first}
        self.losses.append(means["loss"])

    def explain(self):
        """A text: why the step from this state is not finite.

        A step that is not finite does not change the state, so `diagnose` can repeat
        the step.
        """
        return diagnose.explain(
            self.method,
            *(self.state, self.views),
            self.names,
            steps=self.job.schedule_steps,
            seed=self.job.seed,
            micro_batches=self.program.micro_batches,
        )

    def timing(self):
        """The content of timing.json."""
        programs = [self.program, *(self.aside or ())[1:]]
        compiled_s = sum(one.compile_time_s for one in [*programs, self.aligner])
        report = self.aligner.report
        return self.facts | {
            "train_time_s": self.time_s(),
            "compile_time_s": round(compiled_s, 3),
            "micro_batches": self.program.micro_batches,
            "final": self.numbers,
            **({"alignments": report} if report else {}),
        }


def check_finite(state):
    """ValueError where parameters are not finite: their checkpoint would be useless."""
    if spoilt := diagnose.spoilt_parameters(state.params):
        raise ValueError(
            f"training diverged before step {int(state.step)}: not finite: "
            + ", ".join(spoilt)
        )


def is_finite(stats):
    """Whether a step had a finite loss and gradient, and so changed the state."""
    return np.isfinite(stats["loss"]) and stats["nonfinite_gradients"] == 0
