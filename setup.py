"""What pyproject.toml cannot say: the workflow lies beside the packages, and goes with
them, as the data of a package of its own.
"""

import setuptools
from setuptools.command import build_py

PIPELINE = "alignerf.pipeline"
DATA = {
    "alignerf": ["py.typed"],
    "alignerf.kernels": ["*.cc", "*.h"],
    "alignerf.splats": ["*.cc"],
    "alignerf.page": ["**/*.html", "**/*.css", "**/*.js", "*.yaml", "vendor/*"],
    "alignerf.causes.shared": ["*.yaml"],
    "alignerf.tables": ["*.yaml"],
    "alignerf.testsets": ["*.yaml"],
    PIPELINE: [
        *("Snakefile", "environment.yml", "results/published/*.csv"),
        "profiles/*/config.yaml",
        *(
            f"workflow/**/*.{kind}"
            for kind in ("smk", "yaml", "rst", "py", "txt", "md")
        ),
    ],
}


class Build(build_py.build_py):
    """Takes data alone of the folder that the packages lie in."""

    def find_package_modules(self, package, package_dir):
        if package == PIPELINE:
            return []
        return super().find_package_modules(package, package_dir)


setuptools.setup(
    packages=[
        *setuptools.find_namespace_packages(include=["alignerf*", "flow*"]),
        PIPELINE,
    ],
    package_dir={PIPELINE: "."},
    package_data=DATA,
    cmdclass={"build_py": Build},
)
