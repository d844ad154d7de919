/** The page: files in, contours on the canvas while bytes arrive. Decoding is a worker's. */
import type { IsoEvent } from "../../codec/js/src/decoder.js";
import type { Drawing } from "../../codec/js/src/draw.js";
import type { Promises } from "../../codec/js/src/metadata.js";
import type { Answer, PlainEvent, Request } from "../../codec/js/src/worker.js";
import { place, placement } from "../../codec/js/src/world.js";
import { Scene } from "./scene.js";

declare const WORKER: string;

const by = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;
const root = document.documentElement, canvas = by<HTMLCanvasElement>("view"), choice = by<HTMLSelectElement>("isovalue");
const world = by<HTMLInputElement>("world");

/** What is known of the open file. */
interface File {
  id: number;
  n: number;
  shape: number[];
  isovalues: number[];
  metadata: Record<string, string>;
  layers: number[];
  promises: Promises[];
  rows: number[][] | undefined;
  drawing: Drawing | undefined;
  fitted: boolean;
}

const worker = new Worker(URL.createObjectURL(new Blob([WORKER], { type: "text/javascript" })), { type: "module" });
const ask = (request: Request, transfer: Transferable[] = []): void => worker.postMessage(request, transfer);
const scene = new Scene(canvas, (x, y) => {
  by("where").textContent = file?.n === 2 ? `x ${x.toFixed(2)}  y ${y.toFixed(2)}` : "";
});
let file: File | undefined;
let count = 0;
let seen = 0;
const tables = new URL("main.bin", location.href).href;
const parameters = new URLSearchParams(location.search);
const rate = Number(parameters.get("rate")) || undefined;

function begin(name: string, source: { url: string } | { bytes: Uint8Array }): void {
  file = { id: ++count, n: 2, shape: [], isovalues: [], metadata: {}, layers: [], promises: [], rows: undefined,
    drawing: undefined, fitted: false };
  by("hint").hidden = true;
  by("name").textContent = name;
  by("error").textContent = by("size").textContent = "";
  by("layer").textContent = by("promise").textContent = "–";
  by<HTMLProgressElement>("progress").removeAttribute("value");
  choice.replaceChildren();
  choice.disabled = world.disabled = true;
  world.checked = false;
  Object.assign(root.dataset, { state: "open", bytes: "0", cells: "0", layers: "0" });
  const common = { type: "open" as const, id: file.id, tables, ...(rate ? { bytesPerSecond: rate } : {}) };
  if ("bytes" in source) ask({ ...common, bytes: source.bytes }, [source.bytes.buffer]);
  else ask({ ...common, url: source.url });
}

const openFile = async (chosen: globalThis.File | null | undefined): Promise<void> => {
  if (chosen) begin(chosen.name, { bytes: new Uint8Array(await chosen.arrayBuffer()) });
};
const openUrl = (url: string): void => begin(url.split("/").pop() ?? url, { url: new URL(url, location.href).href });

/** The matrix that points are drawn with: that of the file, or axis 1 to the right and axis 0 downwards. */
function rows(): number[][] | undefined {
  if (!file) return undefined;
  if (world.checked && file.rows) return file.rows;
  return file.n === 2 && file.shape.length ? [[0, 1, 0], [-1, 0, 0]] : undefined;
}

function show(): void {
  if (!file?.drawing) return;
  const matrix = rows(), placed = matrix ? place(file.drawing, matrix) : file.drawing;
  if (!file.fitted && placed.cells.length) {
    const { n, shape } = file, corners = new Float64Array((1 << n) * n);
    for (let i = 0; i < 1 << n; i++) for (let a = 0; a < n; a++) corners[n * i + a] = (i >> a) & 1 ? shape[a]! - 1 : 0;
    const box: Drawing = { n, d: n, points: corners, cells: new Uint32Array(0), full: false };
    // of an explicit domain only what is drawn says where it lies
    scene.fit(!shape.length ? placed : matrix ? place(box, matrix) : box);
    file.fitted = true;
  }
  scene.set(placed);
  scene.request();
}

function promised(): void {
  if (!file) return;
  const i = choice.selectedIndex < 0 ? 0 : choice.selectedIndex, layers = file.layers[i] ?? 0;
  const kept = file.promises[i]?.distances.filter((each) => each.layer <= layers).pop();
  by("layer").textContent = String(layers);
  by("promise").textContent = kept ? `within ${kept.distance} samples${file.promises[i]!.topology ? ", topology" : ""}`
    : file.promises[i]?.topology && layers ? "topology" : "–";
}

function happened(event: PlainEvent | IsoEvent): void {
  if (!file) return;
  if (event.type === "header") {
    file.shape = event.header.shape;
    file.n = event.header.n;
    by("size").textContent = event.header.explicit ? "mesh" : `${file.shape.join(" × ")}, ${event.header.profile}`;
    choose(event.header.isovalue);
  } else if (event.type === "isovalue") choose(event.isovalue);
  else if (event.type === "layer") file.layers[event.isovalue] = (file.layers[event.isovalue] ?? 0) + 1;
  else if (event.type === "promises") file.promises[event.isovalue] = event.promises;
  else if (event.type === "metadata") {
    Object.assign(file.metadata, event.metadata);
    file.rows = placement(file.metadata, file.n);
    world.disabled = !file.rows;
  } else if (event.type === "end") root.dataset["state"] = "done";
  else if (event.type === "error") {
    const error = event as PlainEvent & { type: "error" };
    by("error").textContent = error.message;
    root.dataset["state"] = error.kind;
  }
}

function choose(isovalue: number): void {
  file!.isovalues.push(isovalue);
  choice.add(new Option(String(isovalue)));
  choice.disabled = choice.length < 2;
}

worker.onmessage = ({ data: answer }: MessageEvent<Answer>) => {
  if (!file || answer.id !== file.id) return;
  if (answer.type === "failed") {
    by("error").textContent = answer.message;
    root.dataset["state"] = "failed";
    return;
  }
  if (answer.type === "events") {
    answer.events.forEach(happened);
    if (answer.total) by("progress").dataset["total"] = String(answer.total);
    promised();
    return;
  }
  const total = Number(by("progress").dataset["total"]) || 0;
  by("bytes").textContent = answer.bytes.toLocaleString() + (total ? ` of ${total.toLocaleString()}` : "");
  by<HTMLProgressElement>("progress").value = answer.final ? 1 : total ? answer.bytes / total : 0.5;
  file.drawing = answer.drawing;
  show();
  Object.assign(root.dataset, { bytes: answer.bytes, cells: answer.drawing.cells.length / answer.drawing.n,
    layers: answer.layers, final: answer.final, drawings: ++seen });
  requestAnimationFrame(() => ask({ type: "next", id: answer.id }));
};

function pick(i: number): void {
  if (!file || i < 0 || i >= choice.length) return;
  choice.selectedIndex = i;
  promised();
  ask({ type: "isovalue", id: file.id, isovalue: i });
}

function theme(name: string): void {
  root.dataset["theme"] = name;
  scene.theme(name === "dark");
}

function turnWorld(): void {
  if (file) file.fitted = false;
  show();
}

by("open").onclick = () => by<HTMLInputElement>("file").click();
by<HTMLInputElement>("file").onchange = (event) => void openFile((event.target as HTMLInputElement).files?.[0]);
by("fetch").onsubmit = (event) => {
  event.preventDefault();
  openUrl(by<HTMLInputElement>("url").value);
};
choice.onchange = () => pick(choice.selectedIndex);
world.onchange = turnWorld;
by("all").onclick = turnWorld;
by("theme").onclick = () => theme(root.dataset["theme"] === "dark" ? "light" : "dark");
addEventListener("dragover", (event) => {
  event.preventDefault();
  canvas.classList.add("drop");
});
addEventListener("dragleave", () => canvas.classList.remove("drop"));
addEventListener("drop", (event) => {
  event.preventDefault();
  canvas.classList.remove("drop");
  void openFile(event.dataTransfer?.files[0]);
});
addEventListener("keydown", (event) => {
  if (event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement) return;
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const key = event.key.toLowerCase();
  const step = 40, move: Record<string, [number, number]> = {
    arrowleft: [step, 0], arrowright: [-step, 0], arrowup: [0, step], arrowdown: [0, -step],
  };
  if (move[key]) scene.drag(...move[key], event.shiftKey);
  else if (key === "+" || key === "=") scene.zoom(1.25);
  else if (key === "-") scene.zoom(0.8);
  else if (key === "0" || key === "home") turnWorld();
  else if (key === "[") pick(choice.selectedIndex - 1);
  else if (key === "]") pick(choice.selectedIndex + 1);
  else if (key === "t") by("theme").click();
  else if (key === "o") by("open").click();
  else if (key === "w" && !world.disabled) {
    world.checked = !world.checked;
    turnWorld();
  } else return;
  event.preventDefault();
});

theme(parameters.get("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
const given = parameters.get("file");
if (given) openUrl(given);
