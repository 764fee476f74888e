"""The workbench as a web application: its routes, and errors returned as one sentence each."""

from __future__ import annotations

import math
import os
import secrets
from collections.abc import Awaitable, Callable, Collection
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from motoremi.arrays import JsonDict, Progress
from motoremi.data.analyser import ANALYSERS
from motoremi.data.paths import inside
from motoremi.data.plain import object_from_json, plain
from motoremi.data.text import clean_text, clean_value
from motoremi.errors import BadInput, MotoremiError
from motoremi.inspection.compare import Tolerance
from motoremi.interrupts import Cancelled
from motoremi.report.contents import Choice
from motoremi.report.kinds import FORMS, SECTIONS
from motoremi.schema.bench_file import BenchFile
from motoremi.workbench import challenge_view, exports, next_view, side_by_side, spectrum_view, story, views
from motoremi.workbench.bench_view import Asked, Workplace
from motoremi.workbench.desk import Desk
from motoremi.workbench.events import Events
from motoremi.workbench.guard import LABORATORY, REPORT_POLICY, UPLOADS, Guard
from motoremi.workbench.jobs import Jobs
from motoremi.workbench.ladder import Ladder
from motoremi.workbench.letterhead import Letterhead
from motoremi.workbench.listing import Listing, State
from motoremi.workbench.refusal import refusal
from motoremi.workbench.shelf import Shelf
from motoremi.workbench.terms import TERMS
from motoremi.workbench.thinning import Band
from motoremi.workbench.tray import Tray
from motoremi.workbench.watch import Watch

STATIC = Path(str(resources.files("motoremi.workbench") / "static"))
# File types that may be downloaded from a session's report folder.
REPORT_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".pdf": "application/pdf",
    ".json": "application/json",
    ".csv": "text/csv; charset=utf-8",
    ".xml": "application/xml",
}


class Workbench:
    """The state that all requests share.

    Parameters
    ----------
    shelf : Shelf
    bench_file : BenchFile, optional
    profile : Path, optional
        The laboratory profile used for reports; without it, one can be chosen on the page.
    """

    def __init__(self, shelf: Shelf, bench_file: BenchFile | None = None, profile: Path | None = None) -> None:
        self.shelf = shelf
        self.events = Events()
        self.listing = Listing(shelf)
        self.watch = Watch(self.listing, self.events)
        self.place = Workplace(shelf, self.events, bench_file)
        self.jobs = Jobs(self.events)
        self.tray = Tray(lambda: self.events.publish("files", {}))
        self.letterhead = Letterhead(shelf.folder, profile, lambda: self.events.publish("files", {}))

    def desk(self, request: Request) -> Desk:
        """The session named in a request's path."""
        return self.shelf.desk(request.path_params["id"])

    def now(self) -> JsonDict:
        """The current run and jobs, sent to a page when it connects."""
        return {**self.place.state(), "jobs": self.jobs.to_list()}

    def leave(self) -> None:
        """Shut down: cancel computations and bring instruments into their safe state."""
        self.jobs.cancel_all()
        self.place.leave()

    def head(self, request: Request) -> JsonDict:
        """What a session is, and whether it is being measured."""
        head = views.head(self.desk(request), request.path_params["id"])
        state = self.state(request)
        return {**head, "state": state, "resumable": head["resumable"] and state != "measuring"}

    def state(self, request: Request) -> State:
        """The session's state, as in the list of sessions."""
        return self.listing.entry(self.desk(request).path).state


def make_app(workbench: Workbench, token: str, hosts: Collection[str]) -> Guard:
    """The whole application behind its guard."""
    w = workbench
    session = "/api/sessions/{id}"
    routes = [
        Route("/", lambda request: FileResponse(STATIC / "index.html")),
        Mount("/static", StaticFiles(directory=STATIC, follow_symlink=True)),
        Route("/api/events", _stream(w)),
        _get("/api/alive", lambda request: {}),
        _get("/api/terms", lambda request: TERMS),
        _get("/api/bench", lambda request: w.place.overview()),
        _post("/api/bench/look", lambda request, body: w.place.look(Asked.of(body))),
        _post("/api/run", lambda request, body: w.place.begin(Asked.of(body))),
        _post("/api/run/stop", lambda request, body: w.place.stop()),
        _post("/api/run/answer", lambda request, body: w.place.answer(body.get("answer", "done"), body.get("value"))),
        _get("/api/run/trace/{seq:int}", lambda request: w.place.trace(request.path_params["seq"])),
        _get("/api/sessions", lambda request: _sessions(w)),
        _get(session, w.head),
        _get(session + "/curves", lambda request: views.curves(w.desk(request), _band(request))),
        _get(session + "/fails", lambda request: views.fails(w.desk(request))),
        _get(
            session + "/story", lambda request: story.story(w.desk(request), request.query_params.get("of", ""), w.state(request), _band(request))
        ),
        _get(session + "/panels", lambda request: story.panels(w.desk(request), request.query_params.get("of", ""), _band(request))),
        _get(
            session + "/look",
            lambda request: story.look(
                w.desk(request),
                request.query_params.get("of", ""),
                request.query_params.get("effect", ""),
                request.query_params.get("standing"),
                _band(request),
            ),
        ),
        _get(session + "/inspect", lambda request: views.inspection(w.desk(request), request.query_params.get("element", ""), _band(request))),
        _get(session + "/next", lambda request: _next(w, request)),
        _post(session + "/answer", _changing(w, lambda desk, body, progress: next_view.bring(desk, w.tray, body, progress), "diagnosing anew")),
        _post(session + "/investigate", lambda request, body: w.place.investigate(request.path_params["id"], body)),
        _get(session + "/emission", lambda request: spectrum_view.spectra(w.desk(request), _band(request))),
        _get(session + "/challenge", lambda request: challenge_view.revealed(w.desk(request))),
        _post(session + "/resume", lambda request, body: w.place.resume(request.path_params["id"], Asked.of(body))),
        _post(session + "/cancel", lambda request, body: w.jobs.cancel(request.path_params["id"])),
        _post(session + "/fit", _changing(w, lambda desk, body, progress: _ladder(desk, body).fit(_standing(body), progress), "fitting")),
        _post(session + "/diagnose", _changing(w, _diagnose, "diagnosing")),
        _post(session + "/add", _changing(w, lambda desk, body, progress: _add(desk, body, progress), "adding an effect")),
        _post(session + "/drop", _changing(w, lambda desk, body, progress: _step(desk, body, "drop"))),
        _post(session + "/redo", _changing(w, lambda desk, body, progress: _step(desk, body, "redo"))),
        _post(session + "/withdraw", _changing(w, _withdraw)),
        _post(session + "/judge", _changing(w, _judge)),
        _post(session + "/predict", _changing(w, lambda desk, body, progress: spectrum_view.predict(desk, _text(body, "limit")))),
        _get(session + "/report", lambda request: _reports(w, w.desk(request))),
        _post(session + "/report", _changing(w, lambda desk, body, progress: _report(w, desk, body, progress), "writing the report")),
        _post(
            session + "/challenge",
            _changing(w, lambda desk, body, progress: challenge_view.play(desk, _names(body, "answer"), progress), "diagnosing"),
        ),
        _post("/api/challenge", lambda request, body: _new_challenge(w)),
        Route(session + "/report/{name}", _file(w, _report_file)),
        _get(session + "/export", lambda request: {"files": exports.offers(w.desk(request)), "report": w.desk(request).report_files()}),
        Route(session + "/export/{name}", _file(w, _exported)),
        _get("/api/together", lambda request: side_by_side.side_by_side(_chosen(w, request), _band(request))),
        Route("/api/together/{name}", _file(w, _comparison)),
        _get(UPLOADS, lambda request: {**w.tray.to_dict(), "analysers": {one.name: one.title for one in ANALYSERS}}),
        Route(UPLOADS, _upload(w), methods=["POST"]),
        _post(LABORATORY, lambda request, body: w.letterhead.choose(body)),
        _post(UPLOADS + "/fixture", lambda request, body: w.tray.choose_fixture(body.get("fixture"))),
        _post(UPLOADS + "/clear", lambda request, body: w.tray.clear()),
        _post(UPLOADS + "/session", lambda request, body: _import(w, body)),
        _post(UPLOADS + "/{file:int}", lambda request, body: w.tray.change(request.path_params["file"], body.get("used_as"))),
        _post(UPLOADS + "/{file:int}/remove", lambda request, body: w.tray.remove(request.path_params["file"])),
    ]
    return Guard(Starlette(routes=routes, exception_handlers={HTTPException: _no_such_page}), token, hosts)


def _get(path: str, answer: Callable[[Request], Any]) -> Route:
    async def endpoint(request: Request) -> Response:
        return await _in_words(lambda: _json(answer(request)))

    return Route(path, endpoint)


def _post(path: str, answer: Callable[[Request, JsonDict], Any]) -> Route:
    async def endpoint(request: Request) -> Response:
        try:
            body = object_from_json(await request.body() or b"{}")
        except ValueError as error:
            return _sentence(f"the request is not a JSON object: {error}", 400)
        return await _in_words(lambda: _json(answer(request, body)))

    return Route(path, endpoint, methods=["POST"])


def _json(data: Any) -> Response:
    return JSONResponse(clean_value(plain({} if data is None else data)))


def _sentence(text: str, status: int) -> Response:
    return JSONResponse({"error": clean_text(" ".join(text.split()))}, status_code=status)


async def _in_words(answer: Callable[[], Response]) -> Response:
    """Compute a response in a worker thread; any error becomes a response with one sentence."""
    try:
        return await run_in_threadpool(answer)
    except Cancelled:
        return _json({"cancelled": True})
    except MotoremiError as error:
        return _sentence(str(error), 502 if error.exit_status == 3 else 400)
    except OSError as error:
        return _sentence(error.strerror or str(error), 400)
    except Exception as error:
        return _sentence(f"internal error ({type(error).__name__}: {error}); report it", 500)


async def _no_such_page(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return refusal(request.scope, f"{error.detail}: {request.url.path}", error.status_code)


def _changing(w: Workbench, change: Callable[[Desk, JsonDict, Progress], Any], title: str = "a change") -> Callable[[Request, JsonDict], Any]:
    """A handler that changes a session: one change at a time, then every open page is notified."""

    def act(request: Request, body: JsonDict) -> Any:
        desk = w.desk(request)
        try:
            with w.jobs.begin(request.path_params["id"], title) as job:
                return change(desk, body, job.report)
        finally:
            w.watch.look()

    return act


def _stream(w: Workbench) -> Callable[[Request], Awaitable[Response]]:
    async def endpoint(request: Request) -> Response:
        return StreamingResponse(w.events.stream(w.now, w.watch.begin), media_type="text/event-stream")

    return endpoint


def _sessions(w: Workbench) -> JsonDict:
    return {"first": w.shelf.first, "sessions": w.listing.entries()}


def _next(w: Workbench, request: Request) -> JsonDict:
    desk = w.desk(request)
    return next_view.content(desk, w.place.benches(desk.session), request.query_params.getlist("without"))


def _text(body: JsonDict, key: str) -> str:
    value = body.get(key, "")
    if not isinstance(value, str):
        raise BadInput(f"{key} must be text")
    return value


def _standing(body: JsonDict) -> str | None:
    """Identifies the ladder that the page showed when the user clicked; optional for scripts."""
    return _text(body, "standing") if "standing" in body else None


def _names(body: JsonDict, key: str) -> list[str]:
    names = body.get(key, [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise BadInput(f"{key} must be a list of names")
    return names


def _reports(w: Workbench, desk: Desk) -> JsonDict:
    """The report files written so far, the available forms and sections, and the laboratory."""
    return {"files": desk.report_files(), "forms": FORMS, "sections": SECTIONS, **w.letterhead.to_dict(desk.session)}


def _report(w: Workbench, desk: Desk, body: JsonDict, progress: Progress) -> JsonDict:
    choice = Choice(_text(body, "form") or "long", frozenset(_names(body, "sections")))
    return {"files": desk.report(progress, w.letterhead.profile, choice)}


def _withdraw(desk: Desk, body: JsonDict, progress: Progress) -> JsonDict:
    """Withdraw measurements, or use them again."""
    names, restored = _names(body, "names"), body.get("restore") is True
    done = desk.withdraw(names, _text(body, "why"), restored)
    return {"names": list(done.names), "emptied_ladder": done.emptied_ladder, "discarded": done.discarded}


def _diagnose(desk: Desk, body: JsonDict, progress: Progress) -> None:
    challenge_view.refuse_sealed(desk.session)
    _ladder(desk, body).diagnose(progress, _standing(body))


def _ladder(desk: Desk, body: JsonDict) -> Ladder[Any]:
    """The ladder of the sweeps or of the spectra, as the request asks."""
    return story.side(desk, _text(body, "of")).ladder


def _add(desk: Desk, body: JsonDict, progress: Progress) -> JsonDict:
    side = story.side(desk, _text(body, "of"))
    before, after = side.ladder.add(_text(body, "effect"), _standing(body), progress)
    return {"before": side.step(before), "after": side.step(after)}


def _step(desk: Desk, body: JsonDict, do: Literal["drop", "redo"]) -> JsonDict:
    """Drop or redo `count` steps of the ladder; one by default."""
    count = body.get("count", 1)
    if isinstance(count, bool) or not isinstance(count, int):
        raise BadInput("count must be a whole number")
    side = story.side(desk, _text(body, "of"))
    before, after = getattr(side.ladder, do)(_standing(body), count)
    return {"before": side.step(before), "after": side.step(after)}


def _band(request: Request) -> Band | None:
    """The frequency span that a plot is zoomed to, if the request states one."""
    ends = [request.query_params.get(name, "") for name in ("low", "high")]
    if not any(ends):
        return None
    try:
        low, high = map(float, ends)
    except ValueError:
        low = high = 0.0
    if not 0 < low < high < math.inf:
        raise BadInput("low and high must be frequencies in hertz, low below high")
    return low, high


def _judge(desk: Desk, body: JsonDict, progress: Progress) -> None:
    limits = {}
    for key in ("error_percent", "magnitude_db", "phase_deg"):
        value = body.get(key)
        if value is not None and (isinstance(value, bool) or not isinstance(value, (int, float))):
            raise BadInput(f"{key} must be a number")
        limits[key] = value
    desk.judge(Tolerance(**limits))


def _new_challenge(w: Workbench) -> JsonDict:
    folder = challenge_view.new_challenge(w.shelf.fresh("challenge"), secrets.randbelow(2**31))
    return {"session": w.shelf.place(folder)}


def _import(w: Workbench, body: JsonDict) -> JsonDict:
    """Make a session of the dropped files, and remove them from the list."""
    made = w.tray.imported(body)
    folder = w.shelf.named(_text(body, "name") or _text(body, "motor"))
    made.store(folder)
    w.tray.clear()
    identifier = w.shelf.place(folder)
    w.watch.look()
    return {"session": identifier, "notes": [*made.caveats, *(one["text"] for one in made.observations)]}


def _upload(w: Workbench) -> Callable[[Request], Awaitable[Response]]:
    async def endpoint(request: Request) -> Response:
        data = await request.body()
        return await _in_words(lambda: _json(w.tray.take(request.query_params.get("name", ""), data)))

    return endpoint


def _file(w: Workbench, answer: Callable[[Workbench, Request], Response]) -> Callable[[Request], Awaitable[Response]]:
    async def endpoint(request: Request) -> Response:
        return await _in_words(lambda: answer(w, request))

    return endpoint


def _exported(w: Workbench, request: Request) -> Response:
    data = exports.exported(w.desk(request), request.path_params["name"])
    return Response(data, media_type="application/octet-stream", headers={"Content-Disposition": "attachment"})


def _chosen(w: Workbench, request: Request) -> list[Desk]:
    return [w.shelf.desk(one) for one in request.query_params.getlist("session")]


def _comparison(w: Workbench, request: Request) -> Response:
    data = side_by_side.report_file(_chosen(w, request), request.path_params["name"])
    return Response(data, media_type="application/octet-stream", headers={"Content-Disposition": "attachment"})


def _report_file(w: Workbench, request: Request) -> Response:
    name = request.path_params["name"]
    kind = REPORT_TYPES.get(os.path.splitext(name)[1])
    if kind is None:
        raise BadInput("a report has no such file")
    path = inside(w.desk(request).path, f"report/{name}")
    if not path.is_file():
        raise BadInput("this session has no such report file yet: write the report first")
    shown = "inline" if request.query_params.get("show") else "attachment"
    return FileResponse(path, media_type=kind, filename=name, content_disposition_type=shown, headers={"Content-Security-Policy": REPORT_POLICY})
