"""A session with a whole story, its report, and texts that mean harm: shared by the tests of reports."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from few_effects import seeking
from made_once import made_once

import motoremi as me
from motoremi.data.session import SessionWriter, load
from motoremi.data.text import clean_text
from motoremi.emission.setup import scan_frequencies
from motoremi.report.model import Materials, build_report
from motoremi.report.renderings import render_all
from motoremi.simulate.emission_in_time import Stand
from motoremi.simulate.emission_in_time import measure as measure_spectra
from motoremi.workflow import add_to_session, compare_session, diagnose_session, fit_session, ladder_of, opened
from motoremi.workflow_emission import diagnose_emission_session, predict_session

HOSTILE = [
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "]]></testsuite><!--",
    "\x1b[31mred\x1b[0m",
    "nul\x00byte",
    "{{7*7}}{% raw %}",
    "\u202egnp.exe",
    "&amp;&lt;\u2028x",
    "=HYPERLINK(1)",
    '#panic("x") #read("/etc/passwd") $x$ *b* `r` @a // c',
    "\\u{41} \\ #[x] ]) #let title = 1",
    "${jndi:x} $\\frac$",
    "\u7535\u673a",
]


def together(texts: Sequence[str]) -> list[str]:
    """The same texts, several in one: a report takes a second or more, and each field is given every one of them all the same."""
    return [" ".join(texts[first::3]) for first in range(3)]


# Read by programs, not shown: what kind of file, which sweep, which unit.
KEPT = frozenset({"schema", "of", "unit", "sweep", "setup"})


class Poison:
    """Puts one text, each time with a number of its own, into every field, and remembers which number went where."""

    def __init__(self, text: str) -> None:
        self.text, self.places = text, {}

    def __call__(self, place: str) -> str:
        number = f"Q{len(self.places)}Q"
        self.places[number] = place
        return f"{number} {self.text}"

    def found_in(self, shown: str, text: str) -> set[str]:
        """The numbers that stand in front of the whole text, controls written out; verdicts are shown in capitals."""
        upper, whole = squeezed(shown).upper(), squeezed(clean_text(text)).upper()
        return {number for number in self.places if number + whole in upper}

    def into(self, value: Any, place: str) -> Any:
        """Every text inside plain data, names of parameters among them."""
        if isinstance(value, str):
            return self(place)
        if isinstance(value, list):
            return [self.into(item, place) for item in value]
        if isinstance(value, dict):
            named = place.endswith(".parameters")
            return {
                (self(f"{place} name") if named else key): item if key in KEPT else self.into(item, f"{place}.{key}") for key, item in value.items()
            }
        return value


class Page(HTMLParser):
    """Collects tags and checks that they close."""

    VOID = frozenset({"meta", "br", "img", "hr", "link"})

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.open: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs

    def handle_endtag(self, tag: str) -> None:
        assert self.open, tag
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def parsed(html: str) -> Page:
    page = Page()
    page.feed(html)
    assert page.open == []
    return page


def diagnosed_session(path: Path, measure) -> Path:
    """Measured, fitted, compared, diagnosed, and the effect added; made once, then copied."""
    shutil.copytree(made_once("diagnosed-session", lambda target: _make_diagnosed_session(target, measure)), path)
    return path


def _make_diagnosed_session(path: Path, measure) -> None:
    sweeps, _ = measure(2, ("insulation-leakage@Cf",))
    with SessionWriter.create(path, {"title": "A test", "motor": "XQ-7A2", "operator": "B. Engineer"}) as writer:
        for sweep in sweeps:
            writer.add_sweep(sweep)
        writer.add_spectrum(me.Spectrum("peak", [150e3, 154.5e3, 159e3], [40.0, 41.0, 39.0], overload=[False, True, False]))
        writer.close("done")
    with opened(path) as store:
        fit_session(store)
        compare_session(store, me.Tolerance(error_percent=1.0))
        with seeking():
            found = diagnose_session(store)
        add_to_session(store, found.effects[0])


def whole_session(path: Path, measure, **start: object) -> Path:
    """Sweeps, spectra with an arc, and every analysis that a session can hold; made once, then copied. `start` adds to how it began."""
    made = made_once("whole-session", lambda target: _make_whole_session(target, measure))
    if start:
        whole = load(made)
        _write_whole_session(path, whole.sweeps, whole.spectra, start)
        with opened(path) as store:
            for name in whole.analyses:
                store.save_analysis(name, whole.analysis(name))
    else:
        shutil.copytree(made, path)
    return path


def _make_whole_session(path: Path, measure) -> None:
    seed = 3
    sweeps, motor = measure(seed, ("dielectric-loss@Cf",))
    frequency_hz = scan_frequencies()
    read = measure_spectra(motor, Stand.random(seed, ("arc-breakdown",)), frequency_hz, seed, quasi_peak=False)
    spectra = [me.Spectrum(detector, frequency_hz, read.level(detector)) for detector in ("peak", "average")]
    _write_whole_session(path, sweeps, spectra, {})
    with opened(path) as store, seeking():
        for effect in diagnose_session(store).effects:
            add_to_session(store, effect)
        compare_session(store, me.Tolerance(error_percent=1.0))
        diagnose_emission_session(store)
        predict_session(store)


def _write_whole_session(path: Path, sweeps: Sequence[me.ImpedanceSweep], spectra: Sequence[me.Spectrum], start: dict[str, object]) -> None:
    with SessionWriter.create(path, {"title": "All of it", "motor": "motor 3", **start}) as writer:
        identity = {"vendor": "HP", "model": "4294A", "serial": "JP1KG00123", "firmware": "REV1.11"}
        writer.emit("instrument", role="analyser", driver="4294a", resource="GPIB0::17::INSTR", identity=identity, settings={"points": 401})
        for sweep in sweeps:
            writer.add_sweep(sweep)
        for spectrum in spectra:
            writer.add_spectrum(spectrum)
        writer.close("done")


def rendered(path: Path) -> dict[str, bytes]:
    """Every file of the report of a session."""
    session = load(path)
    steps = tuple(ladder_of(session))
    comparison = me.compare(steps[-1], me.Tolerance(error_percent=1.0)) if steps else None
    return render_all(build_report(Materials(session, steps, comparison, session.analysis("diagnosis"))))


def squeezed(text: str) -> str:
    """Without blanks and joints, at which lines break."""
    return "".join(text.replace("\u200b", "").replace("\ufffe", "").split())
