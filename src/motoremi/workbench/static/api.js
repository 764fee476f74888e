// Requests to the workbench; a failure is thrown as Trouble with one sentence.

export class Trouble extends Error {}

async function answer(path, options = {}) {
  let response;
  try {
    response = await fetch(path, options);
  } catch {
    throw new Trouble("the workbench does not answer: it was stopped, or its terminal was closed");
  }
  if (!response.ok) throw new Trouble((await response.json()).error);
  return response;
}

export const ask = async (path, options) => (await answer(path, options)).json();

export const fetchFile = async (path) => (await answer(path)).blob();

export const get = (path) => ask(path);

export const post = (path, body = {}) =>
  ask(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });

// A path with the frequency span that a plot shows.
export const within = (path, span) => (span ? `${path}${path.includes("?") ? "&" : "?"}low=${span[0]}&high=${span[1]}` : path);

export const sessionPath = (id, rest = "") => `/api/sessions/${encodeURIComponent(id)}${rest}`;
