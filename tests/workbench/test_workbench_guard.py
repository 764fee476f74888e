"""Who may talk to the workbench, and what may come out of it."""

from __future__ import annotations

import pytest
from starlette.testclient import TestClient
from workbench_tools import HOST, TOKEN, bench_of, client_of, make_session

from motoremi.workbench.routes import make_app


@pytest.fixture(scope="module")
def workbench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("work")
    make_session(folder / "mine")
    return bench_of(folder)


@pytest.fixture
def stranger(workbench) -> TestClient:
    return TestClient(make_app(workbench, TOKEN, {HOST}), base_url=f"http://{HOST}", follow_redirects=False)


@pytest.fixture
def client(workbench) -> TestClient:
    return client_of(workbench)


@pytest.mark.parametrize("path", ["/", "/static/main.js", "/api/sessions", "/api/events", "/nowhere"])
def test_nothing_without_the_token(stranger, path):
    answer = stranger.get(path)
    assert answer.status_code == 401
    assert "motoremi workbench" in answer.json()["error"]


@pytest.mark.parametrize("token", ["", "wrong", TOKEN[:-1], TOKEN + "x", "ä", "\x00"])
def test_wrong_tokens(stranger, token):
    assert stranger.get("/", params={"token": token}).status_code == 401
    assert stranger.get("/api/sessions", headers={"Authorization": f"Bearer {token}".encode()}).status_code == 401
    assert stranger.get("/api/sessions", headers={"Cookie": f"motoremi-8123={token}".encode()}).status_code == 401


def test_the_address_becomes_a_cookie_and_leaves_the_address_bar(stranger):
    answer = stranger.get("/", params={"token": TOKEN})
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert stranger.get("/").status_code == 200


def test_the_token_in_an_address_opens_nothing_but_the_page(stranger):
    assert stranger.get("/api/sessions", params={"token": TOKEN}).status_code == 401


@pytest.mark.parametrize("host", ["evil.example:8123", "127.0.0.1", "127.0.0.1:8124", "localhost.evil.example:8123", "127.0.0.1:8123@evil", ""])
def test_other_hosts_are_refused(client, host):
    assert client.get("/api/sessions", headers={"Host": host}).status_code == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1:8123", "http://127.0.0.1:9", f"http://{HOST}.evil.example"])
def test_other_origins_are_refused(client, origin):
    assert client.get("/api/sessions", headers={"Origin": origin}).status_code == 403
    assert client.post("/api/challenge", json={}, headers={"Origin": origin}).status_code == 403
    assert "access-control-allow-origin" not in client.options("/api/sessions", headers={"Origin": origin}).headers


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_requests_of_other_pages_are_refused(client, site):
    assert client.get("/api/sessions", headers={"Sec-Fetch-Site": site}).status_code == 403


@pytest.mark.parametrize("kind", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data", ""])
def test_forms_cannot_act(client, kind):
    assert client.post("/api/run/stop", content=b"{}", headers={"Content-Type": kind}).status_code == 415


@pytest.mark.parametrize("body", [b"[]", b"{", b'{"a": NaN}', b"[" * 10_000, b"\xff\xfe"])
def test_a_body_that_is_no_object_is_told(client, body):
    answer = client.post("/api/run", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 400
    assert "\n" not in answer.json()["error"]


def test_a_long_body_is_refused(client):
    assert client.post("/api/run", json={"motor": "x" * 100_000}).status_code == 413
    chunks = (b" " * 1000 for _ in range(100))
    assert client.post("/api/run", content=chunks, headers={"Content-Type": "application/json"}).status_code == 413


@pytest.mark.parametrize("path", ["/", "/static/main.js", "/api/sessions", "/nowhere"])
def test_every_answer_carries_the_policy(client, path):
    headers = client.get(path).headers
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "require-trusted-types-for 'script'" in policy
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cache-control"] == "no-store"


def test_refusals_carry_it_too(stranger):
    assert "default-src 'none'" in stranger.get("/").headers["content-security-policy"]


@pytest.mark.slow
def test_a_report_may_run_nothing(client, workbench):
    identifier = client.get("/api/sessions").json()["sessions"][0]["id"]
    assert client.post(f"/api/sessions/{identifier}/fit", json={}).status_code == 200
    files = client.post(f"/api/sessions/{identifier}/report", json={}).json()["files"]
    assert "report.html" in files
    page = client.get(f"/api/sessions/{identifier}/report/report.html?show=1")
    assert page.status_code == 200
    assert page.headers["content-type"].startswith("text/html")
    assert "script-src" not in page.headers["content-security-policy"]
    assert page.headers["content-security-policy"].endswith("sandbox")
    assert client.get(f"/api/sessions/{identifier}/report/report.json").headers["content-disposition"].startswith("attachment")


@pytest.mark.parametrize(
    "name",
    [
        "..%2fsession.jsonl",
        "%2e%2e%2fmanifest.json",
        "session.jsonl",
        "..%5c..%5cx.html",
        "%2fetc%2fpasswd.html",
        "x%00.html",
        ".hidden.html",
        "none.html",
    ],
)
def test_only_report_files_come_out(client, name):
    identifier = client.get("/api/sessions").json()["sessions"][0]["id"]
    answer = client.get(f"/api/sessions/{identifier}/report/{name}")
    assert answer.status_code in (400, 404)
    assert "error" in answer.json()


@pytest.mark.parametrize("path", ["/static/../guard.py", "/static/%2e%2e/guard.py", "/static/..%2fguard.py", "/static//etc/passwd"])
def test_static_files_stay_inside(client, path):
    assert client.get(path).status_code == 404


@pytest.mark.parametrize("identifier", ["0" * 12, "..", "%2e%2e", "%2ftmp", "mine"])
def test_sessions_are_named_by_the_list_only(client, identifier):
    assert client.get(f"/api/sessions/{identifier}").status_code in (400, 404)


def test_links_in_the_folder_are_not_offered(tmp_path):
    make_session(tmp_path / "elsewhere" / "secret")
    (tmp_path / "work").mkdir()
    (tmp_path / "work" / "linked").symlink_to(tmp_path / "elsewhere" / "secret")
    assert client_of(bench_of(tmp_path / "work")).get("/api/sessions").json()["sessions"] == []


def test_a_report_that_is_a_link_stays_inside(client, workbench, tmp_path):
    (tmp_path / "secret.html").write_text("secret")
    folder = make_session(tmp_path / "linked")
    (folder / "report").mkdir()
    (folder / "report" / "report.html").symlink_to(tmp_path / "secret.html")
    identifier = workbench.shelf.place(folder)
    answer = client.get(f"/api/sessions/{identifier}/report/report.html")
    assert answer.status_code == 400
    assert "symbolic link" in answer.json()["error"]
