// The frame of the page: session, view, keys, theme, and the workbench's events.

import { get, sessionPath, Trouble } from "./api.js";
import { button, h, table } from "./dom.js";
import { acceptDrops } from "./drop.js";
import { connect } from "./link.js";
import { leaveAll, repaint } from "./plot.js";
import { showJobs } from "./progress.js";
import { stay } from "./stay.js";
import { hideTip, loadTerms } from "./terms.js";
import { percent, when } from "./units.js";
import { bench } from "./views/bench.js";
import { challenge } from "./views/challenge.js";
import { emission } from "./views/emission.js";
import { fails } from "./views/fails.js";
import { files } from "./views/files.js";
import { inspect } from "./views/inspect.js";
import { next } from "./views/next.js";
import { report } from "./views/report.js";
import { session } from "./views/session.js";
import { story } from "./views/story.js";
import { together } from "./views/together.js";

const VIEWS = { files, bench, story, session, fails, inspect, next, emission, report, challenge, together };
const WITHOUT_SESSION = new Set(["files", "bench", "challenge", "together"]);
// Views without a key of their own are numbered.
const VIEW_KEYS = Object.fromEntries([...Object.entries(VIEWS).filter(([, view]) => view.key).map(([name, view]) => [view.key.toLowerCase(), name]),
  ...Object.keys(VIEWS).filter((name) => !VIEWS[name].key).map((name, index) => [String(index + 1), name])]);
const KEYS = [
  ["1 - 9", "views, from Bench to Challenge"], ["0 C", "views Files and Compare"], ["T", "light or dark"], ["?", "this list"], ["Esc", "closes this list, a hint or a message"],
  ["Arrow keys", "in plots: cursor (with Shift in larger steps); in Story: up and down the list of effects"], ["+ - 0", "in plots: zoom in, out, show all"],
  ["A B", "in plots: set marks"], ["N", "in Story: what comes next"], ["Enter", "on an effect: add it"], ["D R", "in Story: drop the effect that was added last, put it back"], ["U", "in Session: units"],
];
const NO_SESSION = ["There is no session yet: ", h("a", { href: "#files" }, "make one from your files"), ", ", h("a", { href: "#bench" }, "run a procedure on the bench"), ", or ", h("a", { href: "#challenge" }, "take a challenge"), "."];
const VANISHED = "The folder of this session is gone: it was moved, renamed or deleted. What is shown was read before; nothing more can be done with it here. Choose another session, or put the folder back.";
const main = document.getElementById("main");
const element = (id) => document.getElementById(id);

// State and functions that the views share.
export const page = {
  session: "", head: null, run: null, sessions: [], listeners: new Set(), viewKey: null,

  async choose(id) {
    page.session = id;
    await refreshSessions();
    await page.refresh();
    writeAddress(true);
  },

  async refresh() {
    page.head = page.session ? await get(sessionPath(page.session)) : null;
    writeModel();
  },

  go(view) {
    location.hash = `#${view}`;
  },

  // Runs an action that may take a while or fail; shows either on the page.
  async work(doing, action) {
    quiet();
    const waiting = setTimeout(() => busy(doing), 150);
    try {
      const result = await occupied(action);
      if (!result?.cancelled) return result;
      complain("Cancelled: the session is as it was.", "note");
      return undefined;
    } catch (trouble) {
      if (!(trouble instanceof Trouble)) throw trouble;
      complain(trouble.message);
      return undefined;
    } finally {
      clearTimeout(waiting);
      busy("");
    }
  },

  redraw,
  complain,
  attempt,
};

// Several actions may run at once.
let occupations = 0;

async function occupied(action) {
  occupations++;
  main.setAttribute("aria-busy", "true");
  try {
    return await action();
  } finally {
    if (!--occupations) main.removeAttribute("aria-busy");
  }
}

// Session and view are part of the address: a reload keeps both, and a bookmark works while the workbench runs.
const sessionInAddress = () => new URLSearchParams(location.search).get("session") ?? "";

function writeAddress(step = false) {
  const address = new URL(location.href);
  if (page.session) address.searchParams.set("session", page.session);
  else address.searchParams.delete("session");
  address.hash = wanted();
  if (address.href !== location.href) history[step ? "pushState" : "replaceState"](null, "", address);
}

// An effect that occurs several times stands once, with the number.
function counted(effects) {
  return [...new Set(effects)].map((name) => {
    const number = effects.filter((one) => one === name).length;
    return number > 1 ? `${number} ${name}` : name;
  });
}

function writeModel() {
  const head = page.head;
  element("stands").textContent = "";
  if (!head) return;
  const top = head.ladder.at(-1);
  element("stands").textContent = top ? `model: ${["paper's circuit", ...counted(top.effects)].join(" + ")}, error ${percent(top.rms_error_percent)}` : "no model yet";
}

function complain(text, mood = "bad") {
  const place = element("trouble");
  place.dataset.mood = mood;
  place.replaceChildren(h("span", {}, text), button("Close", quiet));
  place.hidden = false;
}

function quiet() {
  element("trouble").hidden = true;
}

function busy(text) {
  element("busy").textContent = text;
  element("busy").hidden = !text;
}

async function refreshSessions() {
  const { first, sessions } = await get("/api/sessions");
  if (page.session && !sessions.some((one) => one.id === page.session)) {
    complain("The session in this address is not on this workbench's list: choose another one from the list above.");
    page.session = "";
  }
  if (!page.session) page.session = first || sessions[0]?.id || "";
  list(sessions);
}

function list(sessions) {
  page.sessions = sessions;
  const choice = element("session-choice");
  const names = sessions.map((one) => [one.motor || one.name, when(one.began), one.state].filter(Boolean).join(" · "));
  // Where two names are the same, their folders are added.
  choice.replaceChildren(...sessions.map((one, index) => h("option", { value: one.id, title: one.name }, names.indexOf(names[index]) === names.lastIndexOf(names[index]) ? names[index] : `${names[index]} · ${one.name}`)));
  if (!sessions.length) choice.append(h("option", { value: "" }, "none yet"));
  choice.value = page.session;
}

const wanted = () => (location.hash.slice(1) in VIEWS ? location.hash.slice(1) : page.session ? "story" : "files");
let drawing = 0;

// Draws the current view once its data have been read. With `keep`, focus, zoom and typed text are kept.
async function redraw(keep = false) {
  const name = wanted(), turn = ++drawing;
  markTab(name);
  hideTip();
  const read = async () => {
    const view = VIEWS[name];
    if (page.session) await page.refresh();
    const missing = page.session || WITHOUT_SESSION.has(name) ? lacks(view) && view.without : NO_SESSION;
    const data = missing ? null : await view.load?.(page);
    if (turn !== drawing) return;
    const restore = keep && stay(main);
    leaveAll();
    page.listeners.clear();
    main.replaceChildren(h("h1", { class: "unseen" }, view.title));
    if (missing) main.append(h("p", { class: "empty" }, missing));
    else view.draw(main, data, page);
    main.dataset.view = name;
    writeAddress();
    if (keep) restore();
    else scrollTo(0, 0);
  };
  // When a view is kept, the message above it is kept too.
  await (keep ? attempt(read) : page.work("reading", read));
  if (turn === drawing && main.dataset.view !== name) {
    // The view's data could not be read; the message above says why.
    leaveAll();
    main.replaceChildren();
    main.dataset.view = name;
  }
}

async function attempt(action) {
  try {
    return await occupied(action);
  } catch (trouble) {
    if (!(trouble instanceof Trouble)) throw trouble;
    complain(trouble.message);
    return undefined;
  }
}

function markTab(name) {
  for (const link of document.querySelectorAll("#views a")) {
    const current = link.hash === `#${name}`;
    if (current) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
    // On a phone the row of tabs is wider than the screen.
    if (current) link.parentElement.scrollLeft = link.offsetLeft - (link.parentElement.clientWidth - link.offsetWidth) / 2;
  }
}

// The session was changed: by this tab, another one, a run or the command line.
function follow() {
  const view = VIEWS[wanted()];
  if (view.changed) page.listeners.forEach((listener) => listener("changed"));
  else if (view.follows !== false) redraw(true);
  else attempt(page.refresh);
}

function lacks(view) {
  const has = { model: page.head?.ladder.length > 0, diagnosis: page.head?.diagnosed && !page.head.sealed };
  return view.needs !== undefined && !has[view.needs];
}

function theme(next) {
  document.documentElement.dataset.theme = next;
  localStorage.setItem("motoremi-theme", next);
  repaint();
}

function otherTheme() {
  const chosen = document.documentElement.dataset.theme;
  const dark = chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  theme(dark ? "light" : "dark");
}

function keys() {
  const list = element("keys");
  list.replaceChildren(h("h2", {}, "Keys"), table(["key", "does"], KEYS), button("Close", () => list.close()));
  list.showModal();
}

function keydown(event) {
  if (event.key === "Escape") {
    hideTip();
    quiet();
  }
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, select, textarea")) return;
  const name = VIEW_KEYS[event.key.toLowerCase()];
  if (name) {
    page.go(name);
    main.focus();
  } else if (event.key === "?") keys();
  else if (event.key === "t" || event.key === "T") otherTheme();
  else page.viewKey?.(event);
}

function listen() {
  const notify = (kind, data) => [...page.listeners].forEach((listener) => listener(kind, data));
  connect({
    state(data) {
      // Sent without the jobs when a run begins.
      if (data.jobs) showJobs(data.jobs, page);
      page.run = data.run;
      notify("run", page.run);
    },
    run(now) {
      page.run = { ...page.run, ...now };
      notify("run", page.run);
    },
    document({ session, document }) {
      // After a reconnection the state and the stream may overlap.
      if (page.run?.session !== session || page.run.documents.some((one) => one.seq === document.seq)) return;
      page.run.documents.push(document);
      notify("document", document);
    },
    jobs(data) {
      showJobs(data.jobs, page);
    },
    files() {
      notify("files");
    },
    sessions(data) {
      list(data.sessions);
      notify("sessions");
      if (page.session && !data.sessions.some((one) => one.id === page.session)) complain(VANISHED);
      const state = data.sessions.find((one) => one.id === page.session)?.state;
      if (page.head && state && state !== page.head.state) follow();
    },
    changed(data) {
      if (data.session === page.session || VIEWS[wanted()].shows?.(data.session)) follow();
    },
  }, { gone, back });
}

// Controls are disabled while the workbench is gone; afterwards the focus returns to where it was.
let focused = null;

function gone(why) {
  if (element("gone").hidden) focused = document.activeElement;
  element("gone").textContent = why;
  element("gone").hidden = false;
  for (const one of document.querySelectorAll(":is(main, header) :is(button, input, select):enabled")) {
    one.disabled = true;
    one.dataset.off = "";
  }
}

async function back() {
  element("gone").hidden = true;
  for (const one of document.querySelectorAll("[data-off]")) {
    one.disabled = false;
    delete one.dataset.off;
  }
  if (focused?.isConnected) focused.focus({ preventScroll: true });
  await attempt(refreshSessions);
  await redraw(true);
}

async function start() {
  const kept = localStorage.getItem("motoremi-theme");
  if (kept) document.documentElement.dataset.theme = kept;
  element("views").append(...Object.entries(VIEW_KEYS).map(([key, name]) => h("a", { href: `#${name}`, id: name }, h("kbd", {}, key.toUpperCase()), ` ${VIEWS[name].title}`)));
  // The hash names the view, so the skip link must not change it.
  document.querySelector(".skip").addEventListener("click", (event) => { event.preventDefault(); main.focus(); });
  element("theme").addEventListener("click", otherTheme);
  element("help").addEventListener("click", keys);
  element("session-choice").addEventListener("change", async (event) => {
    await page.work("reading", () => page.choose(event.target.value));
    await redraw();
  });
  // The system may change between light and dark.
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  document.addEventListener("keydown", keydown);
  acceptDrops(page);
  page.session = sessionInAddress();
  await attempt(async () => {
    await Promise.all([loadTerms(), refreshSessions()]);
    await page.refresh();
  });
  // Only from here on: the view of the address is drawn first.
  addEventListener("hashchange", () => {
    page.viewKey = null;
    redraw();
  });
  addEventListener("popstate", () => {
    const session = sessionInAddress();
    if (!session || session === page.session) return;
    page.session = element("session-choice").value = session;
    redraw();
  });
  await redraw(true);
  listen();
}

start();
