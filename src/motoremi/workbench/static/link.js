// The connection to the workbench: its events, and whether it still answers.

// The workbench sends an event at least every half second. After SILENCE_MS without one, the page sends a request and waits ANSWER_MS for the answer.
// The time since the last event is checked every CHECK_MS.
const SILENCE_MS = 1000, ANSWER_MS = 600, CHECK_MS = 250;
const STOPPED = "The workbench does not answer: it was stopped, or its terminal was closed. Nothing can be changed until it runs again; this page then continues by itself.";
const ANOTHER_KEY = "The workbench was restarted and has a new key: open the address that it printed.";

// Opens the stream of events and keeps it open. kinds: a handler for each kind of event; gone(why) is called whenever a check finds that the
// workbench does not answer, back() once when it answers again.
export function connect(kinds, { gone, back }) {
  let stream = null, lastEvent = 0, lost = false, asking = false;

  function open() {
    stream = new EventSource("/api/events");
    lastEvent = performance.now();
    for (const kind of ["beat", ...Object.keys(kinds)]) {
      stream.addEventListener(kind, (event) => {
        lastEvent = performance.now();
        kinds[kind]?.(JSON.parse(event.data));
      });
    }
    stream.addEventListener("error", () => {
      close();
      check();
    });
  }

  function close() {
    stream?.close();
    stream = null;
  }

  // Checks whether the workbench still answers, and opens the stream again if it was closed.
  async function check() {
    if (asking || (stream && performance.now() - lastEvent < SILENCE_MS)) return;
    asking = true;
    const why = await unreachable();
    asking = false;
    if (why) {
      close();
      lost = true;
      gone(why);
      return;
    }
    if (!stream) open();
    lastEvent = performance.now();
    if (lost) back();
    lost = false;
  }

  open();
  setInterval(check, CHECK_MS);
}

// Why the workbench cannot be reached; empty if it can.
async function unreachable() {
  try {
    const answer = await fetch("/api/alive", { signal: AbortSignal.timeout(ANSWER_MS) });
    return answer.status === 401 ? ANOTHER_KEY : "";
  } catch {
    return STOPPED;
  }
}
