// The connection to the workbench: its events, and whether it still answers.

// The workbench sends something every half second. After a longer silence the page sends a request and waits this long for the answer.
const SILENCE_MS = 1000, ANSWER_MS = 600, LOOK_MS = 250;
const STOPPED = "The workbench does not answer: it was stopped, or its terminal was closed. Nothing can be changed until it runs again; this page then continues by itself.";
const ANOTHER_KEY = "The workbench was restarted and has a new key: open the address that it printed.";

// kinds: a handler for each kind of event; gone(why) and back() are called when the workbench is lost and when it answers again.
export function connect(kinds, { gone, back }) {
  let stream = null, heard = 0, lost = false, asking = false;

  function open() {
    stream = new EventSource("/api/events");
    heard = performance.now();
    for (const kind of ["beat", ...Object.keys(kinds)]) {
      stream.addEventListener(kind, (event) => {
        heard = performance.now();
        kinds[kind]?.(JSON.parse(event.data));
      });
    }
    stream.addEventListener("error", () => {
      close();
      look();
    });
  }

  function close() {
    stream?.close();
    stream = null;
  }

  async function look() {
    if (asking || (stream && performance.now() - heard < SILENCE_MS)) return;
    asking = true;
    const why = await absent();
    asking = false;
    if (why) {
      close();
      lost = true;
      gone(why);
      return;
    }
    if (!stream) open();
    heard = performance.now();
    if (lost) back();
    lost = false;
  }

  open();
  setInterval(look, LOOK_MS);
}

// Why the workbench cannot be reached; empty if it can.
async function absent() {
  try {
    const answer = await fetch("/api/alive", { signal: AbortSignal.timeout(ANSWER_MS) });
    return answer.status === 401 ? ANOTHER_KEY : "";
  } catch {
    return STOPPED;
  }
}
