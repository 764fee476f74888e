// Requests to the workbench; trouble arrives as one sentence.

export class Trouble extends Error {}

async function ask(path, options = {}) {
  let response;
  try {
    response = await fetch(path, options);
  } catch {
    throw new Trouble("the workbench does not answer: it was stopped, or its terminal was closed");
  }
  const told = await response.json();
  if (!response.ok) throw new Trouble(told.error);
  return told;
}

export const get = (path) => ask(path);

export const post = (path, body = {}) =>
  ask(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });

export const sessionPath = (id, rest = "") => `/api/sessions/${encodeURIComponent(id)}${rest}`;
