"""What pyproject.toml cannot say: the workflow lies beside the packages, and goes with
them, as the data of a package of its own.
"""

import setuptools

WORKFLOW = ["Snakefile", "environment.yml", "workflow/**", "results/published/*.csv"]

setuptools.setup(
    packages=[
        *setuptools.find_namespace_packages(include=["alignerf*", "flow*"]),
        "alignerf.pipeline",
    ],
    package_dir={"alignerf.pipeline": "."},
    package_data={
        "alignerf.page": ["**/*.html", "**/*.css", "**/*.js", "vendor/*"],
        "alignerf.tables": ["*.yaml"],
        "alignerf.pipeline": WORKFLOW,
    },
)
