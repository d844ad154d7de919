/** The page: files in, contours on the canvas while bytes arrive. Decoding is a worker's. */
import type { IsoEvent } from "../../codec/js/src/decoder.js";
import type { Promises } from "../../codec/js/src/metadata.js";
import type { Answer, Drawn, PlainEvent, Request } from "../../codec/js/src/worker.js";
import { placement } from "../../codec/js/src/world.js";
import type { Colour } from "./colours.js";
import { promiseOf } from "./promise.js";
import { Scene } from "./scene.js";
import type { TilesAnswer, TilesRequest } from "./tiles.js";
import { coloursOf, fit, grown, type Seen, upright } from "./upright.js";

declare const WORKER: string;

const by = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;
const root = document.documentElement, canvas = by<HTMLCanvasElement>("view"), choice = by<HTMLSelectElement>("isovalue");
const world = by<HTMLInputElement>("world"), slider = by<HTMLInputElement>("frame");

/** What is known of the open file. */
interface File extends Seen {
  id: number;
  layers: number[];
  promises: Promises[];
  /** Layers of the present frame, whose first isovalue begins it. */
  frame: number;
  /** Times of frames, as the file states them. */
  times: string[];
  /** The number of the isovalue that is shown alone; all are, unless one is. */
  alone: number | undefined;
  /** Of a file in tiles the box in samples and, if it says where it lies, in the world. */
  boxes: [samples: Float64Array, world: Float64Array | undefined] | undefined;
  /** The frame that was chosen; the last one there is, unless one was. */
  chosen: number | undefined;
  /** Where it is, if it is no file of this computer; as it was given, and in full. */
  given: string | undefined;
  url: string | undefined;
  /** The view that the address asks for, until it is shown. */
  wanted: URLSearchParams | undefined;
  sought: string | null;
}

/** Parts of a page in one file by name, in base64. Its workers are of another origin, which reads addresses of data only. */
const parts = new Map([...document.querySelectorAll<HTMLElement>("script[data-name]")].map((part) => [part.dataset["name"]!, part.textContent!]));
const beside = (name: string): string => parts.has(name)
  ? `data:${name.endsWith(".js") ? "text/javascript" : ""};base64,${parts.get(name)}` : new URL(name, location.href).href;
/** A worker from text, which has the policy of the page. */
const start = (...text: string[]): Worker => new Worker(parts.size ? `data:text/javascript,${encodeURIComponent(text.join(""))}`
  : URL.createObjectURL(new Blob(text, { type: "text/javascript" })), { type: "module" });
const worker = start(...["main", "domain", "kernels"].map((name) => `self.${name}=${JSON.stringify(beside(`${name}.js`))};`), WORKER);
const tell = (request: Request, transfer: Transferable[] = []): void => worker.postMessage(request, transfer);
const scene = new Scene(canvas, (x, y) => {
  by("where").textContent = file?.n === 2 ? `x ${x.toFixed(2)}  y ${y.toFixed(2)}` : "";
}, pointed);
let file: File | undefined;
let count = 0;
let seen = 0;
const tables = beside("main.bin"), plane = parts.size ? tables : beside("plane.bin"), kernels = beside("kernels.wasm");
/** What reads a file in tiles, while one is open; and what it was asked for last. */
let tiles: Worker | undefined;
let looked = "";
let timer = 0;
const parameters = new URLSearchParams(location.hash.slice(1));
const rate = Number(parameters.get("rate")) || undefined;
/** What the page looks like, which is not of a view. */
const MANNER = ["rate", "theme", "kernels"].flatMap((name) => parameters.has(name) ? [[name, parameters.get(name)!]] : []);
/** Whether files that say where they lie are shown there at first. */
const inWorld = parameters.get("world") !== "0";
/** Whether large files are decoded with compiled kernels. */
const compiled = parameters.get("kernels") !== "off";

function begin(name: string, source: { url: string; given: string } | { bytes: Uint8Array; given?: string }, wanted?: URLSearchParams): void {
  const frame = wanted?.get("frame"), { given } = source, url = "url" in source ? source.url : undefined;
  file = { id: ++count, n: 2, shape: [], isovalues: [], metadata: {}, layers: [], promises: [], frame: 0, times: [], kind: "grid", alone: undefined,
    drawings: new Map(), box: undefined, boxes: undefined, fitted: false, raised: 1, world: false, chosen: frame ? Number(frame) : undefined,
    given, url, wanted, sought: wanted?.get("isovalue") ?? null };
  scene.clear();
  tiles?.terminate();
  tiles = undefined;
  looked = "";
  by("hint").hidden = true;
  by("name").textContent = name;
  by("error").textContent = by("size").textContent = "";
  by("layer").textContent = by("promise").textContent = "–";
  by<HTMLProgressElement>("progress").removeAttribute("value");
  choice.replaceChildren(new Option("all", ""));
  choice.disabled = world.disabled = true;
  by("legend").hidden = true;
  world.checked = false;
  by("series").hidden = true;
  Object.assign(root.dataset, { state: "open", bytes: "0", cells: "0", layers: "0" });
  const common = { type: "open" as const, id: file.id, tables, plane, ...(compiled ? { kernels } : {}), ...(rate ? { bytesPerSecond: rate } : {}) };
  if ("bytes" in source) tell({ ...common, bytes: source.bytes }, [source.bytes.buffer]);
  else tell({ ...common, url: source.url });
  tell({ type: "show", id: file.id, isovalue: undefined, frame: file.chosen, world: inWorld });
}

const openFile = async (chosen: globalThis.File | null | undefined): Promise<void> => {
  if (chosen) begin(chosen.name, { bytes: new Uint8Array(await chosen.arrayBuffer()) });
};
const openUrl = (given: string, wanted?: URLSearchParams): void => {
  const held = parts.get(given), source = held ? { bytes: Uint8Array.from(atob(held), (letter) => letter.charCodeAt(0)), given } : { url: beside(given), given };
  begin(given.split("/").pop() ?? given, source, wanted);
};

/** Put drawings on the canvas: all anew, if how they are seen has changed. */
function show(some: readonly Drawn[]): void {
  if (!file) return;
  const drawn = [...file.drawings.values()].find(({ cells }) => cells.length);
  if (!file.fitted && drawn) {
    fit(scene, file, drawn.d);
    by("raised").textContent = file.raised === 1 ? "" : file.raised < 0.01 ? "heights not to scale" : `heights × ${file.raised}`;
    some = [...file.drawings].map(([isovalue, drawing]) => ({ isovalue, drawing }));
  }
  for (const { isovalue, drawing } of some) scene.set(isovalue, { ...drawing, points: upright(file, drawing.points, drawing.d) });
  if (drawn && file.wanted && file.world === world.checked) {
    const at = file.wanted.get("at")?.split(",").map(Number) ?? [], turn = file.wanted.get("turn")?.split(",").map(Number) ?? scene.pose.turn;
    const zoom = Number(file.wanted.get("zoom") ?? 1);
    if (at.length === drawn.d && [...at, zoom, ...turn].every(Number.isFinite)) scene.pose = { at, zoom, turn: [turn[0] ?? 0, turn[1] ?? 0] };
    file.wanted = undefined;
  }
}

/** How large something drawn is, and how many isovalues something is drawn of. */
const sizes = (): { cells: string; curves: string } => {
  const counts = [...file!.drawings.values()].map(({ cells, n }) => cells.length / n);
  return { cells: String(counts.reduce((sum, count) => sum + count, 0)), curves: String(counts.filter(Boolean).length) };
};

/** Ask for what is chosen. */
function ask(): void {
  if (!file) return;
  if (tiles) {
    if (file.world !== world.checked) turn();
    look();
  } else tell({ type: "show", id: file.id, isovalue: file.alone, frame: file.chosen, world: world.checked });
}

/** Show a file that says where it lies in these coordinates, unless the address says otherwise. */
function placed(): void {
  world.disabled = false;
  if (!inWorld) return;
  world.checked = true;
  ask();
}

function promised(): void {
  if (!file) return;
  const { alone, layers, promises, isovalues, kind, metadata } = file;
  const numbers = isovalues.map((_, i) => i).filter((i) => alone === undefined || i === alone);
  if (kind !== "tiles") by("layer").textContent = String(numbers.reduce((sum, i) => sum + (layers[i] ?? 0), 0));
  by("promise").textContent = promiseOf(kind, metadata, numbers.map((i) => ({ promises: promises[i], layers: layers[i] ?? 0 }))) ?? "none";
}

function happened(event: PlainEvent | IsoEvent): void {
  if (!file) return;
  if (event.type === "header") {
    file.shape = event.header.shape;
    file.n = event.header.n;
    if (event.header.explicit) file.kind = "mesh";
    by("size").textContent = event.header.explicit ? "mesh" : `${file.shape.join(" × ")}, ${event.header.profile}`;
    choose(event.header.isovalue);
  } else if (event.type === "isovalue") choose(event.isovalue);
  else if (event.type === "layer") file.layers[event.isovalue] = (file.layers[event.isovalue] ?? 0) + 1;
  else if (event.type === "promises") file.promises[event.isovalue] = event.promises;
  else if (event.type === "metadata") {
    const { time, ...notes } = event.metadata;
    Object.assign(file.metadata, notes);
    if (time !== undefined) file.times[file.frame] = time;
    if (file.shape.length && placement(file.metadata, file.n)) placed();
  } else if (event.type === "coordinates") placed();
  else if (event.type === "domain" && event.kind === "surface") {
    file.kind = "surface";
    by("size").textContent = "surface of points";
    legend();
  }
  else if (event.type === "frame" && event.frame > file.frame) {
    file.frame = event.frame;
    file.layers = [];
    slider.max = String(event.frame);
    by("series").hidden = false;
    legend();
  } else if (event.type === "end") root.dataset["state"] = "done";
  else if (event.type === "error") {
    const error = event as PlainEvent & { type: "error" };
    by("error").textContent = error.message;
    root.dataset["state"] = error.kind;
  }
}

function choose(isovalue: number): void {
  const number = file!.isovalues.push(isovalue) - 1;
  choice.add(new Option(String(isovalue), String(number)));
  choice.disabled = number < 1;
  if (file!.sought === String(isovalue)) {
    file!.sought = null;
    pick(number);
  }
}

/** Colours of the isovalues that there are. */
const colours = (): Colour[] => coloursOf(file, root.dataset["theme"] === "dark");

const css = (parts: Colour): string => `rgb(${parts.map((x) => Math.round(255 * x)).join(" ")})`;

/** List the isovalues with their colours, the highest first; of many the list is a scale of which some are named. */
function legend(): void {
  if (!file) return;
  const { isovalues, metadata } = file, all = colours(), list = by("isovalues"), several = isovalues.length > 1;
  scene.theme(root.dataset["theme"] === "dark", (isovalue) => all[isovalue] ?? all[0]!);
  by("legend").hidden = !several;
  if (!several) return;
  const unit = metadata["unit"] ? ` ${metadata["unit"]}` : "", room = Math.max(120, canvas.clientHeight - 150);
  const high = Math.max(3, Math.min(18, Math.floor(room / isovalues.length))), step = Math.ceil(15 / high);
  const down = isovalues.map((_, i) => i).sort((i, j) => isovalues[j]! - isovalues[i]!), named = (place: number): boolean =>
    place === 0 || place === down.length - 1 || ((down.length - 1 - place) % step === 0 && place >= step);
  by("noun").textContent = metadata["labels"] ? "label" : "isovalue";
  by("unit").textContent = metadata["unit"] ? `(${metadata["unit"]})` : "";
  by("legend").style.top = `${canvas.parentElement!.querySelector("header")!.offsetHeight + 8}px`;
  list.replaceChildren(...down.map((i, place) => {
    const row = document.createElement("button"), swatch = document.createElement("i"), text = document.createElement("span");
    row.dataset["isovalue"] = String(i);
    row.title = `${isovalues[i]}${unit}: show it alone, or all again`;
    row.style.height = `${high}px`;
    swatch.style.background = css(all[i]!);
    if (named(place)) text.textContent = String(isovalues[i]);
    row.classList.toggle("other", file!.alone !== undefined && file!.alone !== i);
    row.append(swatch, text);
    row.onclick = () => pick(file!.alone === i ? undefined : i);
    return row;
  }));
}

/** Name the isovalue that is pointed at, beside the pointer and in the legend. */
function pointed(isovalue: number | undefined, x: number, y: number): void {
  const label = by("value"), value = isovalue === undefined ? undefined : file?.isovalues[isovalue];
  label.hidden = value === undefined;
  for (const row of by("isovalues").children) row.classList.toggle("marked", (row as HTMLElement).dataset["isovalue"] === String(isovalue));
  if (value === undefined) delete root.dataset["pointed"];
  else root.dataset["pointed"] = String(value);
  if (value === undefined) return;
  label.textContent = [value, file!.metadata["unit"]].filter((part) => part !== undefined).join(" ");
  label.style.transform = `translate(${x + 12 + label.offsetWidth > canvas.clientWidth ? x - 12 - label.offsetWidth : x + 12}px, ${y + 14}px)`;
}

function failed(kind: string, message: string): void {
  by("error").textContent = message;
  root.dataset["state"] = kind;
}

const tellTiles = (request: TilesRequest, transfer: Transferable[] = []): void => tiles?.postMessage(request, transfer);

/** Let a worker of its own read the file that is being opened, of which these are all bytes if it is no address. */
function openTiles(bytes: Uint8Array | undefined): void {
  tiles = start(`import ${JSON.stringify(beside("tiles.js"))};`);
  tiles.onerror = () => failed("failed", "what reads files in tiles cannot be loaded");
  tiles.onmessage = ({ data }: MessageEvent<TilesAnswer>) => tilesAnswer(data);
  tellTiles({ type: "open", id: file!.id, source: bytes ?? file!.url!, tables, plane }, bytes ? [bytes.buffer] : []);
}

/** Show all of a file in tiles in world coordinates, or in samples again; the curve has to be asked for. */
function turn(): void {
  if (!file?.boxes) return;
  const { n, boxes } = file;
  Object.assign(file, { world: world.checked, box: boxes[Number(world.checked)] });
  file.drawings.clear();
  scene.clear();
  // so that what is asked for is of this plane
  if (n === 2) scene.set(0, { n, d: n, points: new Float64Array(0), cells: new Uint32Array(0) });
  fit(scene, file, n);
  file.fitted = n === 2;
}

/** Ask for what is seen of a file in tiles, unless that was asked for last. */
function look(): void {
  if (!file?.shape.length || !tiles) return;
  const { x, y, pixel } = scene.window(), isovalue = file.alone;
  // axis 0 of the samples runs downwards, axis 1 to the right; of a surface all is asked for
  const window: [number, number][] = file.n !== 2 ? [] : file.world ? [x, y] : [[-y[1], -y[0]], x];
  const asked = JSON.stringify([isovalue ?? null, window, file.n === 2 ? pixel : 0, file.world]);
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
    Object.assign(file, { n, shape, box, boxes: [box, answer.corners], kind: "tiles", metadata: answer.head.metadata });
    world.disabled = !answer.corners;
    world.checked = answer.corners !== undefined && inWorld;
    by("size").textContent = `${shape.join(" × ")}, ${profile}, ${counts.join(" × ")} tiles`;
    turn();
    isovalues.forEach(choose);
    legend();
    promised();
    return look();
  }
  if (answer.world !== file.world) return;
  const { drawing, isovalue, layer, requests, received, final } = answer;
  if (file.alone !== undefined && file.alone !== isovalue) return;
  file.drawings.set(isovalue, drawing);
  by("bytes").textContent = `${received.toLocaleString()} in ${requests} ${requests === 1 ? "request" : "requests"}`;
  by("layer").textContent = String(layer + 1);
  by<HTMLProgressElement>("progress").value = final ? 1 : 0.5;
  show([{ isovalue, drawing }]);
  Object.assign(root.dataset, { bytes: received, requests, layer, ...sizes(), final, drawings: ++seen });
  if (final) root.dataset["state"] = "done";
}

scene.viewed = () => {
  clearTimeout(timer);
  timer = setTimeout(() => {
    look();
    remember();
  }, 150) as unknown as number;
};

/** Keep the view in the address: the file, what of it is chosen, from where and how near it is seen. */
function remember(): void {
  if (!file || file.wanted || file.sought !== null || !file.drawings.size) return;
  const { given, alone, chosen, isovalues } = file, { at, zoom, turn } = scene.pose, short = (x: number): string => String(Number(x.toPrecision(9)));
  const view = new URLSearchParams([...MANNER, ...(given === undefined ? [] : [["file", given]])]);
  if (alone !== undefined) view.set("isovalue", String(isovalues[alone]));
  if (chosen !== undefined) view.set("frame", String(chosen));
  if (!world.disabled) view.set("world", String(Number(world.checked)));
  view.set("at", at.map(short).join(","));
  view.set("zoom", short(zoom));
  if (turn.some((angle) => angle)) view.set("turn", turn.map((angle) => angle.toFixed(4)).join(","));
  // what separates numbers needs no escape
  const text = `#${String(view).replaceAll("%2C", ",").replaceAll("%2F", "/")}`;
  if (text !== location.hash) history.replaceState(null, "", text);
}

worker.onmessage = ({ data: answer }: MessageEvent<Answer>) => {
  if (!file || answer.id !== file.id) return;
  if (answer.type === "failed") return failed("failed", answer.message);
  if (answer.type === "tiles") return openTiles(answer.bytes);
  if (answer.type === "events") {
    const known = file.isovalues.length;
    answer.events.forEach(happened);
    if (file.isovalues.length > known) legend();
    if (answer.total) by("progress").dataset["total"] = String(answer.total);
    promised();
    return;
  }
  const total = Number(by("progress").dataset["total"]) || 0;
  by("bytes").textContent = answer.bytes.toLocaleString() + (total ? ` of ${total.toLocaleString()}` : "");
  by<HTMLProgressElement>("progress").value = answer.final ? 1 : total ? answer.bytes / total : 0.5;
  requestAnimationFrame(() => tell({ type: "next", id: answer.id }));
  // coordinates that were asked for when this was on its way
  if (answer.world !== world.checked && !answer.final) return;
  if (answer.fresh) {
    file.drawings.clear();
    scene.clear();
  }
  for (const { isovalue, drawing } of answer.drawings) file.drawings.set(isovalue, drawing);
  if (answer.world !== file.world || grown(file, answer.box)) file.fitted = false;
  file.box = answer.box;
  file.world = answer.world;
  const time = file.times[answer.frame];
  slider.value = String(answer.frame);
  by("shown").textContent = time === undefined ? slider.value : `${slider.value}: ${time}`;
  show(answer.drawings);
  Object.assign(root.dataset, { bytes: answer.bytes, frame: answer.frame, ...sizes(), layers: answer.layers, final: answer.final, drawings: ++seen });
};

/** Show an isovalue alone, or all. */
function pick(number: number | undefined): void {
  if (!file || number === file.alone || (number !== undefined && !(number in file.isovalues))) return;
  file.alone = number;
  choice.value = number === undefined ? "" : String(number);
  if (tiles) {
    for (const [isovalue] of file.drawings) if (number !== undefined && isovalue !== number) file.drawings.delete(isovalue);
    scene.clear();
    show([...file.drawings].map(([isovalue, drawing]) => ({ isovalue, drawing })));
  }
  legend();
  promised();
  ask();
}

/** Show the isovalue after or before the one that is shown, in the order of the file; all come before the first. */
function pickNext(by: 1 | -1): void {
  const next = (file?.alone ?? -1) + by;
  if (file && next < file.isovalues.length) pick(next < 0 ? undefined : next);
}

function pickFrame(t: number): void {
  if (!file || t < 0 || t > file.frame) return;
  file.chosen = t;
  ask();
}

function theme(name: string): void {
  root.dataset["theme"] = name;
  const all = colours();
  scene.theme(name === "dark", (isovalue) => all[isovalue] ?? all[0]!);
  legend();
}

function showAll(): void {
  if (file) file.fitted = false;
  show([]);
}

by("open").onclick = () => by<HTMLInputElement>("file").click();
by<HTMLInputElement>("file").onchange = (event) => void openFile((event.target as HTMLInputElement).files?.[0]);
by("fetch").onsubmit = (event) => {
  event.preventDefault();
  openUrl(by<HTMLInputElement>("url").value);
};
choice.onchange = () => pick(choice.value === "" ? undefined : Number(choice.value));
world.onchange = ask;
slider.oninput = () => pickFrame(Number(slider.value));
by("all").onclick = showAll;
by("theme").onclick = () => theme(root.dataset["theme"] === "dark" ? "light" : "dark");
addEventListener("resize", legend);
addEventListener("hashchange", () => location.reload());
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
  else if (key === "[") pickNext(-1);
  else if (key === "]") pickNext(1);
  else if (key === "a") pick(undefined);
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
const given = parameters.get("file") ?? [...parts.keys()].find((name) => name.endsWith(".iso"));
if (given) openUrl(given, parameters);
