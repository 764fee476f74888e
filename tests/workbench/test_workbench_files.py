"""Files that are dropped on the page: what is read of them, what is refused, and the session that they become."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import simulated_sweeps
from starlette.testclient import TestClient
from typer.testing import CliRunner
from workbench_tools import ATTACKS, HOST, TOKEN, bench_of, client_of

from motoremi.cli.app import app
from motoremi.data.csvfiles import impedance_csv
from motoremi.data.recognise import recognise
from motoremi.data.session import load, verify
from motoremi.errors import BadInput
from motoremi.workbench import guard, tray
from motoremi.workbench.routes import make_app

SWEEPS = simulated_sweeps(7, repeats=1)[0]
SHORT, OPEN = (impedance_csv(sweep).encode() for sweep in SWEEPS)
SPECTRUM = b"# detector: peak\nfrequency_hz,level_dbuv\n" + b"".join(b"%d,40\n" % hertz for hertz in range(150_000, 1_000_000, 50_000))
LOSS = b'[[correction]]\nname = "pad"\nkind = "loss"\ndb = 10.0\n'
HEADER = {"Content-Type": "application/octet-stream"}


@pytest.fixture
def client(tmp_path) -> TestClient:
    return client_of(bench_of(tmp_path))


def drop(client: TestClient, name: str, data: bytes) -> dict:
    return client.post("/api/files", params={"name": name}, content=data, headers=HEADER).json()


def plain(sweep) -> bytes:
    """The same sweep in a file that does not say its termination."""
    rows = zip(sweep.frequency_hz.tolist(), sweep.impedance_ohm.tolist(), strict=True)
    return ("frequency_hz,resistance_ohm,reactance_ohm\n" + "".join(f"{f!r},{z.real!r},{z.imag!r}\n" for f, z in rows)).encode()


@pytest.mark.parametrize(
    ("name", "data", "used_as", "doubt"),
    [
        ("a.csv", plain(SWEEPS[0]), "short", ""),
        ("a.csv", plain(SWEEPS[1]), "open", ""),
        ("Motor_SC_3.csv", plain(SWEEPS[1]), "short", "is this the open-circuit sweep?"),
        ("motor open.csv", plain(SWEEPS[0]), "open", "is this the short-circuit sweep?"),
        ("open.csv", b"# termination: short\n" + plain(SWEEPS[0]), "short", ""),
        ("a.csv", b"# termination: short\n" + plain(SWEEPS[1]), "short", "is this the open-circuit sweep?"),
        ("short.csv", SPECTRUM, "spectrum", ""),
    ],
)
def test_kind_and_termination_are_recognised(name, data, used_as, doubt):
    found = recognise(data, name)
    assert found.used_as == used_as
    assert found.doubt.endswith(doubt)
    assert bool(found.doubt) == bool(doubt)


def test_what_the_owner_says_goes_before_a_guess():
    assert recognise(plain(SWEEPS[0]), "short.csv", "open").used_as == "open"
    with pytest.raises(BadInput, match="its header says it is the short sweep"):
        recognise(b"# termination: short\n" + plain(SWEEPS[0]), "a.csv", "open")


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("photo.jpg", b"\xff\xd8\xff\xe0" + bytes(range(256)) * 20, "is a photo"),
        ("all.zip", b"PK\x03\x04" + bytes(200), "is a ZIP archive"),
        ("program", bytes(range(256)), "binary file"),
        ("empty.csv", b" \n", "the file is empty"),
        ("paper.pdf", b"%PDF-1.7\n" + bytes(range(128, 256)), "is a PDF"),
    ],
)
def test_what_is_no_text_is_refused_in_one_sentence(client, name, data, says):
    told = drop(client, name, data)
    assert told["error"].startswith(f"{name}: ")
    assert says in told["error"]
    assert "\n" not in told["error"]
    assert client.get("/api/files").json()["files"] == []


def test_the_same_file_twice_is_told(client):
    assert len(drop(client, "a.csv", SHORT)["files"]) == 1
    assert drop(client, "b.csv", SHORT)["error"] == "b.csv: is the same file as a.csv, which is in the list already"
    assert len(drop(client, "c.csv", OPEN)["files"]) == 2


def test_a_text_that_is_no_measurement_stays_in_the_list_with_the_reason(client):
    (one,) = drop(client, "notes.txt", b"hello\nworld\n")["files"]
    assert one["choices"] == ["leave out"]
    assert "needs the columns" in one["trouble"]
    assert "choose at least one file" in client.post("/api/files/session", json={}).json()["error"]


def test_bounds(client, monkeypatch):
    monkeypatch.setattr(guard, "FILE", guard.FILE._replace(most_bytes=200_000))
    assert "longer than" in drop(client, "large.csv", b"1" * 200_001)["error"]
    chunks = (b"1" * 10_000 for _ in range(30))
    assert client.post("/api/files", content=chunks, headers=HEADER).status_code == 413
    monkeypatch.setattr(tray, "MOST_BYTES", len(SHORT) + 10)
    drop(client, "a.csv", SHORT)
    assert "larger than" in drop(client, "b.csv", OPEN)["error"]
    monkeypatch.setattr(tray, "MOST_FILES", 1)
    assert "files in the list already" in drop(client, "b.csv", OPEN)["error"]


@pytest.mark.parametrize("kind", ["application/json", "text/plain", "multipart/form-data", ""])
def test_a_form_cannot_send_a_file(client, kind):
    assert client.post("/api/files", content=SHORT, headers={"Content-Type": kind}).status_code == 415
    assert client.get("/api/files").json()["files"] == []


def test_bytes_are_taken_nowhere_else(client):
    for path in ("/api/run", "/api/files/clear", "/api/files/session"):
        assert client.post(path, content=b"{}", headers=HEADER).status_code == 415


def test_a_stranger_cannot_send_a_file(tmp_path):
    stranger = TestClient(make_app(bench_of(tmp_path), TOKEN, {HOST}), base_url=f"http://{HOST}")
    assert stranger.post("/api/files", content=SHORT, headers=HEADER).status_code == 401
    origin = {"Origin": "http://evil.example", "Authorization": f"Bearer {TOKEN}"}
    assert stranger.post("/api/files", content=SHORT, headers={**HEADER, **origin}).status_code == 403


@pytest.mark.parametrize("attack", ATTACKS)
def test_hostile_names_are_text(client, attack, tmp_path):
    (one,) = drop(client, attack, SHORT)["files"]
    assert one["name"].isprintable()
    assert "/" not in one["name"]
    assert one["name"] not in ("", ".", "..")
    before = {path.name for path in tmp_path.parent.iterdir()}
    made = client.post("/api/files/session", json={"name": attack, "motor": attack})
    assert made.status_code == 200, made.text
    assert {path.name for path in tmp_path.parent.iterdir()} == before
    (folder,) = tmp_path.iterdir()
    assert load(folder).start["imported"] == [one["name"]]


def test_the_session_is_what_the_command_makes(client, tmp_path):
    files = {"s.csv": plain(SWEEPS[0]), "o.csv": plain(SWEEPS[1]), "peak.csv": SPECTRUM, "chain.toml": LOSS}
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
        assert "error" not in drop(client, name, data)
    told = {"motor": "M 7", "analyser": "4294a", "accuracy": "2", "band": "200kHz:20MHz", "operator": "me"}
    identifier = client.post("/api/files/session", json={"name": "by page", "compensated": True, **told}).json()["session"]
    options = [*(part for key, value in told.items() for part in (f"--{key}", value)), "--compensated"]
    by = ["--short", str(tmp_path / "s.csv"), "--open", str(tmp_path / "o.csv"), "--spectrum", str(tmp_path / "peak.csv")]
    done = CliRunner().invoke(app, ["import", str(tmp_path / "by-command"), *by, "--corrections", str(tmp_path / "chain.toml"), *options])
    assert done.exit_code == 0, done.output
    page, command = load(tmp_path / "by-page"), load(tmp_path / "by-command")
    assert {**page.start, "time": "", "sha256": ""} == {**command.start, "time": "", "sha256": ""}
    for one, other in zip(page.sweeps, command.sweeps, strict=True):
        assert np.array_equal(one.impedance_ohm, other.impedance_ohm)
        assert one.metadata == other.metadata
    assert page.corrected_spectra[0].level_dbuv[0] == pytest.approx(50)
    assert not verify(tmp_path / "by-page")
    assert client.get("/api/files").json()["files"] == []
    assert client.get(f"/api/sessions/{identifier}").json()["start"]["motor"] == "M 7"


def test_final_values_of_a_receiver_are_shown_and_imported(client, tmp_path):
    settings = "x-Unit;Hz;\ny-Unit;dBuV;\nValues;2;\n"
    scan = f"Type;ESR7;\nScan 1:\nStart;150000;Hz\nStop;200000;Hz\nRBW;9000;Hz\nTRACE 1:\nDetector;MAX PEAK;\n{settings}150000;60;\n154500;61;\n"
    final = f"TRACE 1 FINAL:\nFinal Detector;QUASI PEAK;\n{settings}1;150000;50.0;\n1;154500;51.0;\n"
    (shown,) = drop(client, "scan.dat", (scan + final).encode())["files"]
    assert (shown["kind"], shown["points"], shown["span"]) == ("spectrum: peak", 2, "150 kHz - 154.5 kHz")
    assert shown["notes"] == ["quasi-peak scan.dat: 2 final values, up to 51.0 dBuV at 154.5 kHz"]
    assert client.post("/api/files/session", json={"motor": "M"}).status_code == 200
    assert [one.level_dbuv.tolist() for one in load(tmp_path / "M").finals] == [[50.0], [51.0]]
    # A stored final value alone is recognised, and refused without scans.
    stored = (tmp_path / "M" / "spectra" / "final-quasi-peak-1.csv").read_bytes()
    (shown,) = drop(client, "final.csv", stored)["files"]
    assert (shown["kind"], shown["points"]) == ("final values", 1)
    refused = client.post("/api/files/session", json={"motor": "N"})
    assert (refused.status_code, "final values alone" in refused.json()["error"]) == (400, True)


def test_terminations_can_be_corrected(client, tmp_path):
    drop(client, "short 1.csv", plain(SWEEPS[1]))
    told = drop(client, "open 1.csv", plain(SWEEPS[0]))
    assert [one["used_as"] for one in told["files"]] == ["short", "open"]
    first, second = (one["id"] for one in told["files"])
    client.post(f"/api/files/{first}", json={"used_as": "open"})
    told = client.post(f"/api/files/{second}", json={"used_as": "leave out"}).json()
    assert [one["used_as"] for one in told["files"]] == ["open", "leave out"]
    assert told["files"][0]["notes"] == []
    assert client.post(f"/api/files/{first}", json={"used_as": "spectrum"}).status_code == 400
    assert client.post("/api/files/session", json={"motor": "M"}).status_code == 200
    assert [sweep.termination for sweep in load(tmp_path / "M").sweeps] == ["open"]
    assert client.post(f"/api/files/{first}", json={"used_as": "open"}).json()["error"] == "this file is not in the list any more"


def test_two_ports_ask_for_their_fixture(client):
    through = 100 / (100 + SWEEPS[1].impedance_ohm)
    rows = zip(SWEEPS[1].frequency_hz.tolist(), through.tolist(), strict=True)
    (one,) = drop(client, "x.s2p", ("# HZ S RI R 50\n" + "".join(f"{f!r} 0 0 {x.real!r} {x.imag!r} 0 0 0 0\n" for f, x in rows)).encode())["files"]
    assert "series-through" in one["trouble"]
    (one,) = client.post("/api/files/fixture", json={"fixture": "series-through"}).json()["files"]
    assert (one["used_as"], one["trouble"]) == ("open", "")
    assert client.post("/api/files/fixture", json={"fixture": "magic"}).status_code == 400


def test_tables_of_corrections_are_dropped_too(client, tmp_path):
    drop(client, "peak.csv", SPECTRUM)
    chain = b'[[correction]]\nname = "cable"\nkind = "loss"\nfile = "cable.csv"\n'
    drop(client, "chain.toml", chain)
    assert "drop that file here as well" in client.post("/api/files/session", json={"name": "x"}).json()["error"]
    told = drop(client, "cable.csv", b"frequency_hz,db\n1e5,3\n1e7,3\n")
    assert [one["kind"] for one in told["files"]][1:] == ["corrections", "table of the corrections"]
    assert client.post("/api/files/session", json={"name": "x"}).status_code == 200
    assert load(tmp_path / "x").corrected_spectra[0].level_dbuv[0] == pytest.approx(43)


@pytest.mark.parametrize("table", ["/etc/hostname", "../secret.csv", "..\\secret.csv"])
def test_corrections_name_no_file_of_this_machine(client, tmp_path, table):
    (tmp_path / "secret.csv").write_text("frequency_hz,db\n1e5,3\n1e7,3\n")
    drop(client, "peak.csv", SPECTRUM)
    drop(client, "chain.toml", f"[[correction]]\nname = 'cable'\nkind = 'loss'\nfile = '{table}'\n".encode())
    assert "drop that file here as well" in client.post("/api/files/session", json={"name": "x"}).json()["error"]


@pytest.mark.parametrize(
    ("told", "says"),
    [
        ({"band": "1:2"}, "0 of 401 points"),
        ({"band": "x"}, "band"),
        ({"accuracy": "-3"}, "accuracy"),
        ({"analyser": "magic"}, "unknown analyser"),
        ({"motor": 7}, "must be text"),
        ({"compensated": "yes"}, "true or false"),
        ({"motor": "x" * 300}, "200"),
    ],
)
def test_what_cannot_be_used_leaves_files_and_folder_as_they_were(client, tmp_path, told, says):
    drop(client, "s.csv", SHORT)
    answer = client.post("/api/files/session", json=told)
    assert answer.status_code == 400
    assert says in answer.json()["error"]
    assert list(tmp_path.iterdir()) == []
    assert len(client.get("/api/files").json()["files"]) == 1


def test_a_name_that_is_taken(client, tmp_path):
    (tmp_path / "M-7").mkdir()
    drop(client, "s.csv", SHORT)
    assert "choose another name" in client.post("/api/files/session", json={"name": "M 7"}).json()["error"]
    assert client.post("/api/files/session", json={}).status_code == 200
    assert any(path.name.startswith("motoremi-import-") for path in tmp_path.iterdir())
