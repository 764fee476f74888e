// Shows running jobs: what is done, progress, elapsed and remaining time, and Cancel.

import { post, sessionPath } from "./api.js";
import { button, h } from "./dom.js";
import { duration } from "./units.js";

// Jobs that are over sooner are not shown.
const AFTER_S = 0.4, TICK_MS = 500;
const place = () => document.getElementById("jobs");
const shown = new Map();

// elapsed and remaining time of a job or a run.
export function times({ elapsed_s: elapsed, remaining_s: remaining }) {
  const left = remaining === null || remaining === undefined ? "" : `, at most about ${duration(Math.max(1, remaining))} left`;
  return `${duration(elapsed)} so far${left}`;
}

// jobs: all running jobs, including those of other sessions, which are named.
export function showJobs(jobs, page) {
  const now = performance.now();
  for (const job of jobs) {
    const entry = shown.get(job.session) ?? made(job, page);
    shown.set(job.session, entry);
    Object.assign(entry, { job, at: now });
  }
  for (const [session, entry] of shown) {
    if (jobs.some((job) => job.session === session)) continue;
    entry.element.remove();
    shown.delete(session);
  }
  draw();
}

function made(job, page) {
  const entry = { page };
  entry.text = h("p", {});
  entry.time = h("p", { class: "note" });
  entry.bar = h("progress", { max: 1, "aria-label": job.title });
  entry.cancel = button("Cancel", async () => {
    entry.cancel.disabled = true;
    await page.work("cancelling", () => post(sessionPath(job.session, "/cancel")));
  }, { class: "cancel" });
  entry.element = h("div", { class: "job", role: "group", "aria-label": job.title }, entry.text, entry.bar, entry.time, entry.cancel);
  return entry;
}

// Called on a timer as well: elapsed and remaining time go on between two messages.
function draw() {
  const now = performance.now();
  for (const { job, at, element, text, time, bar, cancel, page } of shown.values()) {
    const since = (now - at) / 1000, elapsed = job.elapsed_s + since;
    if (elapsed < AFTER_S) continue;
    const own = job.session === page.session ? "" : ` (${page.sessions.find((one) => one.id === job.session)?.name ?? "another session"})`;
    text.textContent = `${job.title}${own}${job.doing ? `: ${job.doing}` : ""}`;
    bar.value = job.share;
    time.textContent = job.cancelled ? "cancelling" : times({ elapsed_s: elapsed, remaining_s: job.remaining_s === null ? null : job.remaining_s - since });
    if (job.cancelled) cancel.disabled = true;
    if (!element.isConnected) place().append(element);
  }
  place().hidden = !place().childElementCount;
}

setInterval(draw, TICK_MS);
