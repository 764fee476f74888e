"""The laboratory's profile: what it may hold, what a logo may be, and numbers that are given once."""

from __future__ import annotations

import base64
import threading
from datetime import date
from pathlib import Path

import pytest
from laboratory_cases import PROFILE, SVG, png, profile

import motoremi as me
from motoremi.data.laboratory import ONLY_THE_ITEM, laboratory_of, read_laboratory
from motoremi.data.logo import checked_png, png_logo, svg_logo
from motoremi.data.register import register_of, take_number

SVG_START = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 4 2">'


def test_a_profile_comes_back_as_it_is_stored(tmp_path):
    read = read_laboratory(profile(tmp_path, 'logo = "logo.svg"\n' + PROFILE))
    assert (read.name, read.address, read.series) == ("EMC Laboratory North", ("Harbour Road 1", "20457 Hamburg"), "EMC-2026-")
    assert read.statement == ONLY_THE_ITEM
    assert read.calibration_interval == 365
    assert read.equipment[0].calibrated == date(2026, 1, 15)
    assert "<svg" in read.logo_svg
    assert laboratory_of(read.to_dict(), "stored") == read
    assert read_laboratory(profile(tmp_path, 'name = "X"\nlogo = "logo.png"')).logo_png


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("name = ", "is not TOML"),
        ("address = 'x'", "name"),
        ("name = 'x'\nnumber = 1", "number: unknown key"),
        ("name = 'x'\nlogo = 'nowhere.svg'", "no such file"),
        ("name = 'x'\nlogo = 'lab.toml'", "is not an image"),
        ("name = 'x'\nlogo_svg = '<svg/>'", "name the file"),
        ("name = 'x'\ncalibration_interval = '3 m'", "calibration_interval"),
        ("name = 'x'\n[[equipment]]\nkind = 'LISN'\nname = 'y'\ndue = 'soon'", "lab.toml: y: due: "),
        ("name = 'x'\n[decision_rule]\nrule = 'y'", "decision_rule.source"),
    ],
)
def test_a_bad_profile_is_one_line(tmp_path, text, told):
    with pytest.raises(me.BadInput) as caught:
        read_laboratory(profile(tmp_path, text))
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "inside",
    [
        "<script>alert(1)</script>",
        '<rect width="1" height="1" onload="alert(1)"/>',
        '<image href="http://example.org/x.png" width="1" height="1"/>',
        '<use xlink:href="file:///etc/passwd#x"/>',
        '<rect width="1" height="1" style="fill: url(http://example.org/x)"/>',
        "<style>@import 'http://example.org/x.css';</style>",
        "<style>rect { fill: u\\72l(http://example.org) }</style>",
        "<foreignObject><p/></foreignObject>",
        '<g id="a"><use href="#a"/></g>',
        "".join(f'<g id="g{n}">{f"""<use href="#g{n + 1}"/>""" * 10}</g>' for n in range(9)) + '<g id="g9"><rect width="1" height="1"/></g>',
    ],
)
def test_a_logo_that_would_do_something_is_refused(inside):
    with pytest.raises(me.BadInput, match=r"^logo\.svg: "):
        svg_logo(f"{SVG_START}{inside}</svg>", "logo.svg")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<html/>",
        "<svg",
        "<svg/>",
        '<svg xmlns="http://www.w3.org/2000/svg"/>',
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 0 nan"/>',
        '<!DOCTYPE svg [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1">&b;</svg>',
        SVG_START + "<g>" * 5000 + "</g>" * 5000 + "</svg>",
    ],
)
def test_what_is_no_drawing_is_refused(text):
    with pytest.raises(me.BadInput, match=r"^logo\.svg: "):
        svg_logo(text, "logo.svg")


def test_a_logo_keeps_its_drawing_and_nothing_else():
    head = '<?xml version="1.0"?><!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/x.dtd"><!-- secret -->'
    inkscape = '<x:meta xmlns:x="http://inkscape" who="me"/><metadata>me</metadata>'
    kept = svg_logo(f'{head}{SVG_START}{inkscape}<defs><path id="p" d="M0 0h1"/></defs><use xlink:href="#p"/></svg>', "logo.svg")
    assert "#p" in kept
    assert not any(word in kept for word in ("secret", "inkscape", "who", "DOCTYPE", "metadata"))
    assert svg_logo(kept, "logo.svg") == kept


def test_pixels_are_written_anew_and_small():
    stored = png_logo(png(3000, 1500) + b"trailing secret", "logo.png")
    assert len(stored) < 30_000
    assert b"secret" not in base64.b64decode(stored)
    assert checked_png(stored, "logo.png") == stored
    for data in (png()[:-30], b"\x89PNG\r\n\x1a\n", png(7000, 1), b"GIF89a"):
        with pytest.raises(me.BadInput, match=r"^logo\.png: "):
            png_logo(data, "logo.png")


def test_a_large_file_is_no_logo(tmp_path):
    (tmp_path / "big.svg").write_text(SVG + " " * 2_100_000)
    with pytest.raises(me.BadInput, match="too large for a logo"):
        read_laboratory(profile(tmp_path, 'name = "x"\nlogo = "big.svg"'))


def test_a_stored_logo_is_checked_like_a_file():
    for stored in ({"logo_svg": "<svg onload='x'/>"}, {"logo_png": "AAAA"}):
        with pytest.raises(me.BadInput, match="is not an image"):
            laboratory_of({"name": "x", **stored}, "session")


def test_numbers_run_on_and_data_keep_theirs(tmp_path):
    lab = tmp_path / "lab.toml"
    today = date(2026, 3, 4)
    assert [take_number(lab, "A-", digest, today) for digest in ("x", "y", "x")] == ["A-0001", "A-0002", "A-0001"]
    assert take_number(lab, "B-", "x", today) == "B-0001"
    assert register_of(lab).read_text().splitlines()[1] == "A-0002,2026-03-04,y"


def test_two_reports_at_once_get_two_numbers(tmp_path):
    numbers: list[str] = []
    threads = [
        threading.Thread(target=lambda n=n: numbers.append(take_number(tmp_path / "lab.toml", "A-", f"data {n}", date(2026, 1, 1))))
        for n in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=30)
    assert sorted(numbers) == [f"A-{n:04d}" for n in range(1, 9)]


def test_a_damaged_register_is_one_line(tmp_path):
    register_of(tmp_path / "lab.toml").write_text("A-0001\n")
    with pytest.raises(me.BadInput, match="line 1: is not an entry"):
        take_number(tmp_path / "lab.toml", "A-", "x", date(2026, 1, 1))
    assert isinstance(register_of(Path("a/lab.toml")).name, str)
