"""Commands that show what is installed and connected: instruments, doctor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import AsJson, command

if TYPE_CHECKING:
    from motoremi.arrays import JsonDict
    from motoremi.bench.survey import Answer

Ask = Annotated[
    list[str] | None,
    typer.Option("--ask", metavar="RESOURCE", help="Also ask this resource, such as a socket, which VISA does not list.", show_default=False),
]
PACKAGES = ("motoremi", "numpy", "scipy", "pandas", "scikit-rf", "pyvisa", "pyvisa-py", "pyvisa-sim", "pyserial", "matplotlib", "jinja2")
# Optional packages and their purpose.
OPTIONAL = {
    "h5py": "export to HDF5",
    "xarray": "export to HDF5",
    "pyarrow": "export to Parquet",
    "typst": "report as PDF",
    "distributed": "fleet on a Dask cluster",
    "starlette": "workbench",
    "uvicorn": "workbench",
    "gpib-ctypes": "GPIB without a vendor's VISA",
    "pyusb": "USB instruments without a vendor's VISA",
    "psutil": "search for network instruments on all interfaces",
    "zeroconf": "search for network instruments by name",
}


def instruments_(as_json: AsJson = False, ask: Ask = None) -> None:
    """The known drivers, and the instruments that answer on the bus."""
    from motoremi.bench.connect import driver_names
    from motoremi.bench.survey import load_trouble, title
    from motoremi.cli.output import emit_json, say
    from motoremi.virtual.virtual_instruments import VIRTUAL_INSTRUMENTS

    broken = load_trouble()
    known = {name: title(name) for name in driver_names() if name not in broken}
    answers, trouble = _bus(ask)
    if as_json:
        resources = [answer.resource for answer in answers]
        document = {"drivers": known, "broken": broken, "simulated": sorted(VIRTUAL_INSTRUMENTS), "resources": resources}
        emit_json({"schema": "motoremi.instruments/1", **document, "answers": [answer.to_dict() for answer in answers], "trouble": trouble})
        return
    for name, line in sorted(known.items()):
        say(f"{name:10s} {line}")
    for name, reason in broken.items():
        say(f"{name:10s} CANNOT BE LOADED: {reason}")
    _say_bus(answers, trouble)


def doctor_(as_json: AsJson = False, ask: Ask = None) -> None:
    """Check what is installed, which connections work, and which instruments answer."""
    import platform
    import shutil

    from motoremi.bench.survey import load_trouble
    from motoremi.cli.output import emit_json, say

    packages = {name: _version(name) for name in PACKAGES}
    optional = {name: _version(name) for name in OPTIONAL}
    programs = {name: shutil.which(name) is not None for name in ("ngspice", "chromium")}
    backends = _backends()
    broken = load_trouble()
    answers, trouble = _bus(ask)
    if as_json:
        document: JsonDict = {
            "schema": "motoremi.doctor/1",
            "python": platform.python_version(),
            "packages": packages,
            "optional": optional,
            "programs": programs,
            "backends": backends,
            "broken": broken,
            "resources": [answer.resource for answer in answers],
            "answers": [answer.to_dict() for answer in answers],
            "trouble": trouble,
        }
        emit_json(document)
        return
    say(f"Python {platform.python_version()}")
    for name, number in packages.items():
        say(f"  {name:12s} {number or 'MISSING: pip install ' + name}")
    for name, purpose in OPTIONAL.items():
        say(f"  {name:12s} {optional[name] or f'not installed; only for: {purpose}'}")
    for name, present in programs.items():
        say(f"  {name:12s} {'found' if present else 'not found (only the tests need it)'}")
    say("ways to instruments:")
    for name, state in backends.items():
        say(f"  {name:12s} {state}")
    for name, reason in broken.items():
        say(f"driver {name} cannot be loaded: {reason}")
    _say_bus(answers, trouble)


def _version(package: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _backends() -> dict[str, str]:
    """The system's VISA library, and what PyVISA-py can open without one."""
    from pyvisa.highlevel import get_wrapper_class

    found = [str(path) for path in get_wrapper_class("ivi").get_library_paths()]
    state = {"system VISA": ", ".join(found) or "none; PyVISA-py takes its place"}
    info = get_wrapper_class("py").get_debug_info()
    for name, detail in info.items() if isinstance(info, dict) else ():
        if name != "Version":
            lines = detail if isinstance(detail, list | tuple) else str(detail).splitlines()
            state[name] = str(next(iter(lines), "")).strip()
    return state


def _bus(ask: list[str] | None) -> tuple[list[Answer], str]:
    """The instruments that answer, and the error if VISA cannot be used."""
    from motoremi.bench.connect import open_manager
    from motoremi.bench.survey import survey
    from motoremi.errors import InstrumentError

    try:
        manager = open_manager()
        try:
            return survey(manager, ask or ()), ""
        finally:
            manager.close()
    except InstrumentError as error:
        return [], str(error)


def _say_bus(answers: list[Answer], trouble: str) -> None:
    from motoremi.cli.output import say

    if not answers:
        say(f"on the bus: nothing{f' ({trouble})' if trouble else ''}; ask a socket with --ask TCPIP::HOST::PORT::SOCKET")
    for answer in answers:
        fitting = f" -> driver {' or '.join(answer.drivers)}" if answer.drivers else " -> no driver" if answer.identity else ""
        say(f"{answer.resource}: {answer.identity or answer.trouble}{fitting}")


def register(app: typer.Typer) -> None:
    """Add these commands."""
    command(app, "instruments", instruments_, "motoremi instruments --ask TCPIP::192.168.1.20::5025::SOCKET")
    command(app, "doctor", doctor_, "motoremi doctor")
