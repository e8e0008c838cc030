"""Installs the node, its launch file and its example configuration, as ament_python has it."""

from pathlib import Path

from setuptools import setup

NAME = "bottomlock_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", sorted(map(str, Path("config").iterdir()))),
        (f"share/{NAME}/launch", sorted(map(str, Path("launch").iterdir()))),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The bottomlock authors",
    maintainer_email="maintainers@bottomlock.invalid",
    description="bottomlock's live engine as a lifecycle node",
    license="MIT OR Apache-2.0",
    entry_points={"console_scripts": [f"bottomlock_node = {NAME}.node:main"]},
)
