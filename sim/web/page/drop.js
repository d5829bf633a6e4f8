// Logs come in: dropped anywhere on the page, or chosen.

import { button, element } from "./element.js";

const EXPERIMENT = "experiment.toml";

/** Fills `host` with the place to drop logs; `taken` gets lists of `{ name, file }`, one for each experiment or else one for all. */
export function dropPlace(host, { taken, sample }) {
  const chooser = (properties, attributes = {}) => {
    const input = element("input", { type: "file", hidden: true, multiple: true, ...properties, attributes });
    input.addEventListener("change", () => {
      const files = [...input.files].map((file) => ({ name: file.webkitRelativePath || file.name, file }));
      // The same files may be chosen again.
      input.value = "";
      if (files.length) taken(grouped(files));
    });
    return input;
  };
  const files = chooser({ id: "choose-logs" });
  const folder = chooser({ id: "choose-folder" }, { webkitdirectory: "" });
  const place = element("div", { className: "drop" },
    element("p", { className: "headline", textContent: "Drop logs here" }),
    element("p", {}, "or ", button("Choose logs", () => files.click()), " ", button("Choose a folder", () => folder.click()),
      " ", button("Take the sample", sample, { id: "sample" })),
    files, folder);
  host.append(place);

  // Files that are dragged over the page; what is within it may come and go meanwhile.
  let depth = 0;
  const isOfFiles = (event) => event.dataTransfer?.types.includes("Files");
  const mark = (by) => {
    depth = Math.max(0, depth + by);
    place.classList.toggle("over", depth > 0);
  };
  addEventListener("dragenter", (event) => isOfFiles(event) && mark(1));
  addEventListener("dragleave", (event) => isOfFiles(event) && mark(-1));
  addEventListener("dragover", (event) => isOfFiles(event) && event.preventDefault());
  addEventListener("drop", async (event) => {
    if (!isOfFiles(event)) return;
    event.preventDefault();
    mark(-depth);
    const found = await dropped(event.dataTransfer);
    if (found.length) taken(grouped(found));
  });
}

/** What is read, for who wonders. */
export function formatList(formats) {
  return element("details", { className: "formats" },
    element("summary", { textContent: "What is read" }),
    element("ul", {}, formats.map((format) => element("li", { textContent: format }))));
}

/** The files that were dropped, those in folders too. */
async function dropped(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  if (!entries.length) return [...transfer.files].map((file) => ({ name: file.name, file }));
  return (await Promise.all(entries.map((entry) => below(entry, "")))).flat();
}

async function below(entry, path) {
  const name = path + entry.name;
  if (entry.isFile) return [{ name, file: await new Promise((resolve, reject) => entry.file(resolve, reject)) }];
  const reader = entry.createReader();
  const found = [];
  for (;;) {
    // It gives some at a time.
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (!some.length) return (await Promise.all(found.map((one) => below(one, `${name}/`)))).flat();
    found.push(...some);
  }
}

/** Files of each experiment's folder by themselves, named within it; all others as logs, by their names. */
function grouped(files) {
  const parts = (name) => name.split("/");
  const seen = files.filter(({ name }) => !parts(name).some((part) => part.startsWith(".")));
  const folders = seen.filter(({ name }) => parts(name).pop() === EXPERIMENT).map(({ name }) => name.slice(0, -EXPERIMENT.length));
  const groups = folders.map((folder) => seen
    .filter(({ name }) => name.startsWith(folder))
    .map(({ name, file }) => ({ name: name.slice(folder.length), file })));
  const logs = seen
    .filter(({ name }) => !folders.some((folder) => name.startsWith(folder)))
    .map(({ name, file }) => ({ name: parts(name).pop(), file }));
  return logs.length ? [...groups, logs] : groups;
}

/** Whether these are the files of an experiment. */
export function isExperiment(files) {
  return files.some(({ name }) => name === EXPERIMENT);
}
