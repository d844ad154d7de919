/** The page: files in, contours on the canvas while bytes arrive. Decoding is a worker's. */
import type { IsoEvent } from "../../codec/js/src/decoder.js";
import type { Drawing } from "../../codec/js/src/draw.js";
import type { Promises } from "../../codec/js/src/metadata.js";
import type { Answer, PlainEvent, Request } from "../../codec/js/src/worker.js";
import { placement } from "../../codec/js/src/world.js";
import { Scene } from "./scene.js";
import type { TilesAnswer, TilesRequest } from "./tiles.js";

declare const WORKER: string;

const by = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;
const root = document.documentElement, canvas = by<HTMLCanvasElement>("view"), choice = by<HTMLSelectElement>("isovalue");
const world = by<HTMLInputElement>("world"), slider = by<HTMLInputElement>("frame");

/** What is known of the open file. */
interface File {
  id: number;
  n: number;
  shape: number[];
  isovalues: number[];
  metadata: Record<string, string>;
  layers: number[];
  promises: Promises[];
  /** Layers of the present frame, whose first isovalue begins it. */
  frame: number;
  drawing: Drawing | undefined;
  box: Float64Array | undefined;
  /** Of a file in tiles the box in samples and, if it says where it lies, in the world. */
  boxes: [samples: Float64Array, world: Float64Array | undefined] | undefined;
  /** Whether all of it has been shown, in world coordinates or others. */
  fitted: boolean;
  world: boolean;
  /** The frame that was chosen; the last one there is, unless one was. */
  chosen: number | undefined;
  /** Where it is, if it is no file of this computer. */
  url: string | undefined;
}

const start = (...text: string[]): Worker => new Worker(URL.createObjectURL(new Blob(text, { type: "text/javascript" })), { type: "module" });
const beside = (name: string): string => new URL(name, location.href).href;
const worker = start(...["main", "kernels"].map((name) => `self.${name}=${JSON.stringify(beside(`${name}.js`))};`), WORKER);
const tell = (request: Request, transfer: Transferable[] = []): void => worker.postMessage(request, transfer);
const scene = new Scene(canvas, (x, y) => {
  by("where").textContent = file?.n === 2 ? `x ${x.toFixed(2)}  y ${y.toFixed(2)}` : "";
});
let file: File | undefined;
let count = 0;
let seen = 0;
const tables = beside("main.bin"), kernels = beside("kernels.wasm");
/** What reads a file in tiles, while one is open; and what it was asked for last. */
let tiles: Worker | undefined;
let looked = "";
let timer = 0;
const parameters = new URLSearchParams(location.search);
const rate = Number(parameters.get("rate")) || undefined;
/** Whether large files are decoded with compiled kernels. */
const compiled = parameters.get("kernels") !== "off";

function begin(name: string, source: { url: string } | { bytes: Uint8Array }): void {
  file = { id: ++count, n: 2, shape: [], isovalues: [], metadata: {}, layers: [], promises: [], frame: 0,
    drawing: undefined, box: undefined, boxes: undefined, fitted: false, world: false, chosen: undefined, url: "url" in source ? source.url : undefined };
  tiles?.terminate();
  tiles = undefined;
  looked = "";
  by("hint").hidden = true;
  by("name").textContent = name;
  by("error").textContent = by("size").textContent = "";
  by("layer").textContent = by("promise").textContent = "–";
  by<HTMLProgressElement>("progress").removeAttribute("value");
  choice.replaceChildren();
  choice.disabled = world.disabled = true;
  world.checked = false;
  by("series").hidden = true;
  Object.assign(root.dataset, { state: "open", bytes: "0", cells: "0", layers: "0" });
  const common = { type: "open" as const, id: file.id, tables, ...(compiled ? { kernels } : {}), ...(rate ? { bytesPerSecond: rate } : {}) };
  if ("bytes" in source) tell({ ...common, bytes: source.bytes }, [source.bytes.buffer]);
  else tell({ ...common, url: source.url });
}

const openFile = async (chosen: globalThis.File | null | undefined): Promise<void> => {
  if (chosen) begin(chosen.name, { bytes: new Uint8Array(await chosen.arrayBuffer()) });
};
const openUrl = (url: string): void => begin(url.split("/").pop() ?? url, { url: new URL(url, location.href).href });

/** Points with axis 1 to the right and axis 0 downwards, as rows and columns are written; others as they are. */
function upright(points: Float64Array): Float64Array {
  if (!file || file.n !== 2 || !file.shape.length || file.world) return points;
  return points.map((_, i) => (i & 1 ? -points[i - 1]! : points[i + 1]!));
}

function show(): void {
  if (!file?.drawing) return;
  const { drawing, box } = file;
  if (!file.fitted && drawing.cells.length) {
    scene.fit(drawing.d, upright(box!));
    file.fitted = true;
  }
  scene.set({ ...drawing, points: upright(drawing.points) });
  scene.request();
}

/** Ask for what is chosen. */
function ask(): void {
  if (!file) return;
  if (tiles) {
    if (file.world !== world.checked) turn();
    look();
  } else tell({ type: "show", id: file.id, isovalue: Math.max(0, choice.selectedIndex), frame: file.chosen, world: world.checked });
}

function promised(): void {
  if (!file || tiles) return;
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
    if (file.shape.length && placement(file.metadata, file.n)) world.disabled = false;
  } else if (event.type === "coordinates") world.disabled = false;
  else if (event.type === "frame" && event.frame > file.frame) {
    file.frame = event.frame;
    file.layers = [];
    slider.max = String(event.frame);
    by("series").hidden = false;
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

function failed(kind: string, message: string): void {
  by("error").textContent = message;
  root.dataset["state"] = kind;
}

const tellTiles = (request: TilesRequest, transfer: Transferable[] = []): void => tiles?.postMessage(request, transfer);

/** Let a worker of its own read the file that is being opened, of which these are all bytes if it is no address. */
function openTiles(bytes: Uint8Array | undefined): void {
  tiles = new Worker(beside("tiles.js"), { type: "module" });
  tiles.onerror = () => failed("failed", "what reads files in tiles cannot be loaded");
  tiles.onmessage = ({ data }: MessageEvent<TilesAnswer>) => tilesAnswer(data);
  tellTiles({ type: "open", id: file!.id, source: bytes ?? file!.url!, tables }, bytes ? [bytes.buffer] : []);
}

/** Show all of a file in tiles in world coordinates, or in samples again; the curve has to be asked for. */
function turn(): void {
  if (!file?.boxes) return;
  const { n, boxes } = file;
  Object.assign(file, { world: world.checked, box: boxes[Number(world.checked)], drawing: undefined, fitted: n === 2 });
  scene.set({ n, d: n, points: new Float64Array(0), cells: new Uint32Array(0) });
  scene.fit(n, upright(file.box!));
}

/** Ask for what is seen of a file in tiles, unless that was asked for last. */
function look(): void {
  if (!file?.shape.length || !tiles) return;
  const { x, y, pixel } = scene.window(), isovalue = Math.max(0, choice.selectedIndex);
  // axis 0 of the samples runs downwards, axis 1 to the right; of a surface all is asked for
  const window: [number, number][] = file.n !== 2 ? [] : file.world ? [x, y] : [[-y[1], -y[0]], x];
  const asked = JSON.stringify([isovalue, window, file.n === 2 ? pixel : 0, file.world]);
  if (asked === looked) return;
  looked = asked;
  root.dataset["state"] = "open";
  tellTiles({ type: "look", id: file.id, isovalue, window, pixel, world: file.world });
}

function tilesAnswer(answer: TilesAnswer): void {
  if (!file || answer.id !== file.id) return;
  if (answer.type === "failed") return failed(answer.kind, answer.message);
  if (answer.type === "opened") {
    const { n, shape, profile, isovalues, tiles: counts } = answer.head;
    const box = Float64Array.from([...shape.map(() => 0), ...shape.map((s) => s - 1)]);
    Object.assign(file, { n, shape, box, boxes: [box, answer.corners] });
    world.disabled = !answer.corners;
    by("size").textContent = `${shape.join(" × ")}, ${profile}, ${counts.join(" × ")} tiles`;
    isovalues.forEach(choose);
    scene.fit(n, upright(file.box!));
    file.fitted = n === 2;
    return look();
  }
  if (answer.world !== file.world) return;
  const { drawing, layer, requests, received, final } = answer;
  file.drawing = drawing;
  by("bytes").textContent = `${received.toLocaleString()} in ${requests} ${requests === 1 ? "request" : "requests"}`;
  by("layer").textContent = String(layer + 1);
  by<HTMLProgressElement>("progress").value = final ? 1 : 0.5;
  show();
  Object.assign(root.dataset, { bytes: received, requests, layer, cells: drawing.cells.length / drawing.n, final, drawings: ++seen });
  if (final) root.dataset["state"] = "done";
}

scene.viewed = () => {
  clearTimeout(timer);
  if (tiles) timer = setTimeout(look, 150) as unknown as number;
};

worker.onmessage = ({ data: answer }: MessageEvent<Answer>) => {
  if (!file || answer.id !== file.id) return;
  if (answer.type === "failed") return failed("failed", answer.message);
  if (answer.type === "tiles") return openTiles(answer.bytes);
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
  file.box = answer.box;
  if (answer.world !== file.world) file.fitted = false;
  file.world = answer.world;
  slider.value = by("shown").textContent = String(answer.frame);
  show();
  Object.assign(root.dataset, { bytes: answer.bytes, frame: answer.frame, cells: answer.drawing.cells.length / answer.drawing.n,
    layers: answer.layers, final: answer.final, drawings: ++seen });
  requestAnimationFrame(() => tell({ type: "next", id: answer.id }));
};

function pick(i: number): void {
  if (!file || i < 0 || i >= choice.length) return;
  choice.selectedIndex = i;
  promised();
  ask();
}

function pickFrame(t: number): void {
  if (!file || t < 0 || t > file.frame) return;
  file.chosen = t;
  ask();
}

function theme(name: string): void {
  root.dataset["theme"] = name;
  scene.theme(name === "dark");
}

function showAll(): void {
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
world.onchange = ask;
slider.oninput = () => pickFrame(Number(slider.value));
by("all").onclick = showAll;
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
  if (event.target instanceof HTMLSelectElement || (event.target instanceof HTMLInputElement && event.target.type !== "checkbox"))
    return;
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const key = event.key.toLowerCase();
  const step = 40, move: Record<string, [number, number]> = {
    arrowleft: [step, 0], arrowright: [-step, 0], arrowup: [0, step], arrowdown: [0, -step],
  };
  if (move[key]) scene.drag(...move[key], event.shiftKey);
  else if (key === "+" || key === "=") scene.zoom(1.25);
  else if (key === "-") scene.zoom(0.8);
  else if (key === "0" || key === "home") showAll();
  else if (key === "[") pick(choice.selectedIndex - 1);
  else if (key === "]") pick(choice.selectedIndex + 1);
  else if (key === ",") pickFrame(Number(slider.value) - 1);
  else if (key === ".") pickFrame(Number(slider.value) + 1);
  else if (key === "t") by("theme").click();
  else if (key === "o") by("open").click();
  else if (key === "w" && !world.disabled) {
    world.checked = !world.checked;
    ask();
  } else return;
  event.preventDefault();
});

theme(parameters.get("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
const given = parameters.get("file");
if (given) openUrl(given);
