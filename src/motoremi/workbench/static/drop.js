// Files dropped anywhere on the page are sent to the workbench and shown in the view Files, or in Next as the answer to what it asks for.

import { ask } from "./api.js";

// The workbench's own limit; larger files are not sent.
const LARGEST = 64 * 1024 ** 2;

// One sentence for each refused file; the view shows them.
export const refused = [];

export function acceptDrops(page) {
  const carriesFiles = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
  let depth = 0;
  const over = (on) => document.body.classList.toggle("dropping", on);
  document.addEventListener("dragenter", (event) => { if (carriesFiles(event)) over(++depth > 0); });
  document.addEventListener("dragleave", (event) => { if (carriesFiles(event)) over(--depth > 0); });
  document.addEventListener("dragover", (event) => { if (carriesFiles(event)) event.preventDefault(); });
  document.addEventListener("drop", (event) => {
    if (!carriesFiles(event)) return;
    event.preventDefault();
    depth = 0;
    over(false);
    take([...event.dataTransfer.files], page);
  });
}

export async function take(files, page) {
  refused.length = 0;
  await page.work(`reading ${files.length} file${files.length > 1 ? "s" : ""}`, async () => {
    for (const file of files) {
      try {
        await send(file);
      } catch (trouble) {
        refused.push(trouble.message);
      }
    }
  });
  if (["#files", "#next"].includes(location.hash)) await page.redraw(true);
  else page.go("files");
}

async function send(file) {
  if (file.size > LARGEST) throw new Error(`${file.name}: is larger than 64 MiB, the most that a measurement file may have; export fewer points`);
  let content;
  try {
    content = await file.arrayBuffer();
  } catch {
    throw new Error(`${file.name}: cannot be read; it may be a folder, or have been deleted`);
  }
  return ask(`/api/files?name=${encodeURIComponent(file.name)}`, { method: "POST", headers: { "Content-Type": "application/octet-stream" }, body: content });
}
