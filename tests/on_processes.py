"""One of several processes that train: run by test_consensus, with its number set.

Writes the loss of each step as JSON lines. What is to befall it is said by name.
"""

import argparse
import json
import os
import sys

from alignerf import train
from alignerf.io import faults
from alignerf.processes import consensus
from alignerf.training import checkpoint, loop


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--config", required=True)
    # The first process ends after this step.
    parser.add_argument("--dies-at", type=int)
    # Trained once more, from the beginning, in another folder.
    parser.add_argument("--again")
    args = parser.parse_args()
    loop.FETCH_EVERY, loop.CHECKPOINT_EVERY_S = 1, 0.0
    todo = [out for out in (args.out, args.again) if out]
    let_happen(args, todo)
    with consensus.together():
        while todo:
            given = arguments(args, todo.pop(0))
            train.run(faults.arguments(given, None, train.OPTIONS))


def arguments(args, out):
    return [
        *("--config", args.config, "--scene", args.scene),
        *("--checkpoints", f"{out}/checkpoints"),
        *("--timing", f"{out}/timing.json", "--learnt", f"{out}/learnt"),
        *("--threads", "1"),
    ]


def let_happen(args, todo):
    """Each step's loss is said; in the last training what is asked for happens."""
    save = checkpoint.save

    def save_and_say(folder, state, *, final, **facts):
        save(folder, state, final=final, **facts)
        print(json.dumps({"step": int(state.step), "loss": final["loss"]}), flush=True)
        if not todo and int(state.step) == args.dies_at:
            os._exit(9)

    checkpoint.save = save_and_say


if __name__ == "__main__":
    sys.exit(faults.exit_code(main))
