// The connection to the workbench: what it tells by itself, and whether it is still there.

// The workbench is heard every half second; a page that hears nothing for longer asks, and waits no longer than this for the answer.
const SILENCE_MS = 1000, ANSWER_MS = 600, LOOK_MS = 250;
const STOPPED = "The workbench does not answer: it was stopped, or its terminal was closed. Nothing can be changed until it is back; this page goes on by itself then.";
const ANOTHER_KEY = "The workbench was started anew and has another key: open the address that it printed.";

// kinds: what is done with each kind of event; gone(why) and back() when the workbench goes and comes.
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

// Why the workbench cannot be reached; nothing if it can.
async function absent() {
  try {
    const answer = await fetch("/api/alive", { signal: AbortSignal.timeout(ANSWER_MS) });
    return answer.status === 401 ? ANOTHER_KEY : "";
  } catch {
    return STOPPED;
  }
}
