"""Files that the user names: the data of a session are never replaced; links, pipes and permissions stay."""

from __future__ import annotations

import os
import stat
import sys
import threading
from pathlib import Path

import pytest
from command_line import motoremi
from conftest import simulated_sweeps

from motoremi.data.output_file import write_output
from motoremi.data.session import SessionWriter, verify

posix = pytest.mark.skipif(sys.platform == "win32", reason="no links, pipes and permissions of this kind there")


@pytest.fixture(scope="module")
def session(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("output") / "one"
    with SessionWriter.create(folder, {"title": "output"}) as writer:
        for sweep in simulated_sweeps(3)[0]:
            writer.add_sweep(sweep)
        writer.close("done")
    return folder


@pytest.mark.parametrize("name", ["sweeps/short-1.csv", "session.jsonl", "sweeps/new.csv", "Manifest.json"])
def test_the_data_of_a_session_are_not_replaced(session, name):
    done = motoremi("export", session, "--csv", session / name)
    assert done.returncode == 2
    assert "whose files are never replaced" in done.stderr
    assert verify(session) == []


@posix
def test_nor_through_a_link(session, tmp_path):
    link = tmp_path / "table.csv"
    link.symlink_to(session / "sweeps" / "short-1.csv")
    done = motoremi("export", session, "--csv", link)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert verify(session) == []


def test_nothing_is_written_if_one_of_several_names_is_refused(session, tmp_path):
    assert motoremi("export", session, "--touchstone", tmp_path / "open.s1p", "--csv", session / "session.jsonl").returncode == 2
    assert list(tmp_path.iterdir()) == []


def test_no_command_makes_the_folder_of_a_file(session, tmp_path):
    for command in (("export", session, "--csv"), ("plot", session, "sweeps", "--out")):
        done = motoremi(*command, tmp_path / "mistyped" / "x.svg")
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert f"there is no folder {tmp_path / 'mistyped'}; make it first, or name another" in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["open.s2p", "open.foo", "open"])
def test_one_port_has_the_ending_of_one_port(session, tmp_path, name):
    done = motoremi("export", session, "--touchstone", tmp_path / name)
    assert done.returncode == 2
    assert "written as .s1p or .z1p" in done.stderr


@posix
def test_a_link_stays_a_link(tmp_path):
    kept, link = tmp_path / "kept.csv", tmp_path / "link.csv"
    link.symlink_to(kept)
    write_output(link, b"new")
    assert link.is_symlink()
    assert kept.read_bytes() == b"new"


@posix
def test_permissions_stay(tmp_path):
    private = tmp_path / "private.csv"
    private.write_bytes(b"old")
    private.chmod(0o600)
    write_output(private, b"new")
    assert stat.S_IMODE(private.stat().st_mode) == 0o600
    assert private.read_bytes() == b"new"


@posix
def test_a_pipe_receives_the_data(tmp_path):
    pipe, received = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: received.append(pipe.read_bytes()))
    reader.start()
    write_output(pipe, b"through the pipe")
    reader.join(10)
    assert received == [b"through the pipe"]
    assert pipe.is_fifo()


def test_a_plot_does_not_replace_a_file_of_a_session(session):
    done = motoremi("plot", session, "sweeps", "--out", session / "sweeps" / "plot.svg")
    assert done.returncode == 2
    assert "whose files are never replaced" in done.stderr
    assert verify(session) == []
