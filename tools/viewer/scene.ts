/**
 * Drawing with WebGL 2, and the camera: curves as segments of an even width, surfaces shaded by normals of their vertices, each
 * isovalue in its colour; and which isovalue is at a pixel.
 */
import type { Drawing } from "../../codec/js/src/draw.js";

const CURVES = `#version 300 es
in vec4 ends;
uniform mat3 camera;
uniform vec2 size;
uniform float wide;
void main() {
  vec2 p = (camera * vec3(ends.xy, 1.)).xy, q = (camera * vec3(ends.zw, 1.)).xy;
  vec2 way = (q - p) * size, along = length(way) > 0. ? normalize(way) : vec2(1., 0.);
  float side = gl_VertexID % 2 == 0 ? -1. : 1., end = gl_VertexID < 2 ? -1. : 1.;
  vec2 shift = (vec2(-along.y, along.x) * side + along * end) * wide / size;
  gl_Position = vec4((end < 0. ? p : q) + shift, 0., 1.);
}`;

const FLAT = `#version 300 es
precision highp float;
uniform vec4 colour;
out vec4 result;
void main() { result = colour; }`;

const SURFACE = `#version 300 es
in vec3 position;
in vec3 normal;
uniform mat4 camera;
uniform mat4 view;
out vec3 facing;
void main() {
  facing = mat3(view) * normal;
  gl_Position = camera * vec4(position, 1.);
}`;

// the light is that of pictures, over the viewer's left shoulder; both sides are lit alike
const SHADED = `#version 300 es
precision highp float;
in vec3 facing;
uniform vec4 colour;
out vec4 result;
void main() {
  vec3 n = dot(facing, facing) > 0. ? normalize(facing) : vec3(0., 0., 1.);
  if (n.z < 0.) n = -n;
  float lit = .3 + .7 * max(0., dot(n, normalize(vec3(-.4, .5, 1.))));
  // what is seen through is denser where it is seen from the side
  result = vec4(colour.rgb * lit + .06 * pow(n.z, 24.), colour.a + (1. - colour.a) * .8 * pow(1. - n.z, 2.));
}`;

type Vector = [number, number, number];
/** Where from and how near a scene is seen: its middle, how much larger than all of it, and two turns. */
export interface Pose {
  at: number[];
  zoom: number;
  turn: [number, number];
}

/** The drawing of one isovalue in the buffers of the card. */
interface Part {
  drawing: Pick<Drawing, "n" | "d" | "cells"> & { points: Float64Array };
  points: WebGLBuffer;
  normals: WebGLBuffer | undefined;
  index: WebGLBuffer | undefined;
  count: number;
  /** The diagonal of what it spans. */
  extent: number;
}

/** Opacity of surfaces around another one. */
const VEIL = 0.35;
/** Pixels from a curve at which it is meant. */
const NEAR = 5;

/** Normals of points, the mean of those of their triangles by area; of a surface whose points `d = 3` numbers each are. */
function normals(points: Float32Array, cells: Uint32Array): Float32Array {
  const sum = new Float32Array(points.length);
  for (let c = 0; c < cells.length; c += 3) {
    const i = 3 * cells[c]!, j = 3 * cells[c + 1]!, k = 3 * cells[c + 2]!;
    const ax = points[j]! - points[i]!, ay = points[j + 1]! - points[i + 1]!, az = points[j + 2]! - points[i + 2]!;
    const bx = points[k]! - points[i]!, by = points[k + 1]! - points[i + 1]!, bz = points[k + 2]! - points[i + 2]!;
    const x = ay * bz - az * by, y = az * bx - ax * bz, z = ax * by - ay * bx;
    for (const v of [i, j, k]) {
      sum[v]! += x;
      sum[v + 1]! += y;
      sum[v + 2]! += z;
    }
  }
  return sum;
}

export class Scene {
  private readonly gl: WebGL2RenderingContext;
  private readonly programs: WebGLProgram[];
  private readonly parts = new Map<number, Part>();
  /** Numbers of isovalues by pixel of the page, plus 1, two bytes each; while they are those of the present view. */
  private ids: Uint8Array | undefined;
  private readonly target: { frame: WebGLFramebuffer; colour: WebGLRenderbuffer; depth: WebGLRenderbuffer };
  /** The isovalue that is pointed at. */
  private marked: number | undefined;
  private colours: (isovalue: number) => Vector = () => [0, 0, 0];
  /** Coordinates of a point. */
  private d = 2;
  private dark = false;
  private waiting = false;
  /** What is looked at, relative to `origin`, and how large; the turn in the plane; the view from which side. */
  private origin: Vector = [0, 0, 0];
  private centre: Vector = [0, 0, 0];
  private extent = 1;
  private scale = 1;
  /** How much shorter a unit along x is than one along y: degrees of longitude in the middle of a map. */
  private shrunk = 1;
  private angle = 0;
  private yaw = 0;
  private pitch = 0;
  /** Called when the view has changed and is drawn. */
  viewed: () => void = () => undefined;
  private readonly pointers = new Map<number, [number, number]>();

  constructor(private readonly canvas: HTMLCanvasElement, private readonly where: (x: number, y: number) => void,
              private readonly pointed: (isovalue: number | undefined, x: number, y: number) => void) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.gl = gl;
    this.programs = [this.program(CURVES, FLAT), this.program(SURFACE, SHADED), this.program(SURFACE, FLAT)];
    this.target = { frame: gl.createFramebuffer()!, colour: gl.createRenderbuffer()!, depth: gl.createRenderbuffer()! };
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    new ResizeObserver(() => this.request()).observe(canvas);
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    });
    for (const name of ["pointerup", "pointercancel"] as const)
      canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => this.moved(event));
    canvas.addEventListener("pointerleave", () => this.mark(undefined, 0, 0));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY / 500), event.offsetX, event.offsetY);
    }, { passive: false });
  }

  private program(vertex: string, fragment: string): WebGLProgram {
    const { gl } = this, program = gl.createProgram()!;
    for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(type)!;
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ["ends", "normal"].forEach((name, i) => gl.bindAttribLocation(program, i, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) ?? "no shader");
    return program;
  }

  /** Draw nothing from now on. */
  clear(): void {
    for (const isovalue of [...this.parts.keys()]) this.remove(isovalue);
    this.request();
  }

  private remove(isovalue: number): void {
    const { points, normals, index } = this.parts.get(isovalue)!;
    for (const buffer of [points, normals, index]) if (buffer) this.gl.deleteBuffer(buffer);
    this.parts.delete(isovalue);
  }

  /** Draw this of an isovalue from now on. */
  set(isovalue: number, drawing: Part["drawing"]): void {
    if (this.parts.has(isovalue)) this.remove(isovalue);
    this.d = drawing.d;
    this.parts.set(isovalue, this.loaded(drawing));
    this.request();
  }

  /** A drawing on the card; 32 bits are precise enough relative to `origin`. */
  private loaded(drawing: Part["drawing"]): Part {
    const { gl, origin } = this, { n, d, points, cells } = drawing;
    const held = (target: number, data: Float32Array | Uint32Array): WebGLBuffer => {
      const buffer = gl.createBuffer()!;
      gl.bindBuffer(target, buffer);
      gl.bufferData(target, data, gl.DYNAMIC_DRAW);
      return buffer;
    };
    if (d === 2) {
      const ends = new Float32Array(2 * cells.length);
      for (let i = 0; i < cells.length; i++) {
        ends[2 * i] = points[2 * cells[i]!]! - origin[0];
        ends[2 * i + 1] = points[2 * cells[i]! + 1]! - origin[1];
      }
      return { drawing, points: held(gl.ARRAY_BUFFER, ends), normals: undefined, index: undefined, count: cells.length / 2, extent: 0 };
    }
    const at = Float32Array.from(points, (x, i) => x - origin[i % 3]!), low = [0, 0, 0], high = [0, 0, 0];
    at.forEach((x, i) => {
      low[i % 3] = i < 3 ? x : Math.min(low[i % 3]!, x);
      high[i % 3] = i < 3 ? x : Math.max(high[i % 3]!, x);
    });
    return { drawing, points: held(gl.ARRAY_BUFFER, at), normals: n === 3 ? held(gl.ARRAY_BUFFER, normals(at, cells)) : undefined,
      index: held(gl.ELEMENT_ARRAY_BUFFER, cells), count: cells.length, extent: Math.hypot(...low.map((x, a) => high[a]! - x)) };
  }

  /** Show all of some points, of `n` coordinates, from their side (3-D). */
  fit(n: number, points: Float64Array, turn: [number, number] = [0, 0], shrunk = 1): void {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    points.forEach((x, i) => {
      low[i % n] = Math.min(low[i % n]!, x);
      high[i % n] = Math.max(high[i % n]!, x);
    });
    this.origin = low.map((x, a) => (a < n ? (x + high[a]!) / 2 : 0)) as Vector;
    this.centre = [0, 0, 0];
    this.shrunk = shrunk;
    const sides = low.slice(0, n).map((x, a) => (high[a]! - x) * (a ? 1 : shrunk));
    const aspect = this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight - 90);
    this.extent = n === 2 ? Math.max(sides[1]!, sides[0]! / aspect) || 1 : Math.hypot(...sides) || 1;
    this.scale = 1;
    this.angle = 0;
    [this.yaw, this.pitch] = turn;
    // what is there lies relative to another origin now
    for (const [isovalue, { drawing }] of [...this.parts]) this.set(isovalue, drawing);
    this.request();
  }

  /** From where it is seen, in the coordinates of what is drawn; `d` as of it. */
  get pose(): Pose {
    const { d, centre, origin, scale, angle, yaw, pitch } = this;
    return { at: centre.slice(0, d).map((x, a) => x + origin[a]!), zoom: scale, turn: d === 2 ? [angle, 0] : [yaw, pitch] };
  }

  set pose({ at, zoom, turn }: Pose) {
    at.forEach((x, a) => (this.centre[a] = x - this.origin[a]!));
    this.scale = Math.max(0.05, Math.min(1e6, zoom));
    if (this.d === 2) [this.angle] = turn;
    else [this.yaw, this.pitch] = turn;
    this.request();
  }

  theme(dark: boolean, colours: (isovalue: number) => Vector): void {
    this.dark = dark;
    this.colours = colours;
    this.request();
  }

  /** Draw as soon as the browser does; `moved` unless the isovalue at each pixel stays. */
  request(moved = true): void {
    if (moved) this.ids = undefined;
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
      this.viewed();
    });
  }

  /** World units of a pixel of the page. */
  private get pixel(): number {
    return (this.extent * 1.08) / (this.scale * Math.max(1, this.canvas.clientHeight - 90));
  }

  /** Move by pixels; `other` turns a plane and moves a space, which is turned otherwise. */
  drag(dx: number, dy: number, other: boolean): void {
    const { pixel, centre } = this;
    if (this.d === 2) {
      if (other) this.angle += dx / 200;
      else {
        const c = Math.cos(this.angle), s = Math.sin(this.angle);
        centre[0] -= ((c * dx - s * dy) * pixel) / this.shrunk;
        centre[1] += (s * dx + c * dy) * pixel;
      }
    } else if (!other) {
      this.yaw += dx / 150;
      this.pitch = Math.max(-Math.PI, Math.min(0, this.pitch + dy / 150));
    } else {
      const v = this.rotation();
      for (let a = 0; a < 3; a++) centre[a]! += (-dx * v[4 * a]! + dy * v[4 * a + 1]!) * pixel;
    }
    this.request();
  }

  zoom(by: number, x = this.canvas.clientWidth / 2, y = this.canvas.clientHeight / 2): void {
    const before = this.d === 2 ? this.at(x, y) : undefined;
    this.scale = Math.max(0.05, Math.min(1e6, this.scale * by));
    if (before) {
      const after = this.at(x, y);
      this.centre[0] += before[0] - after[0];
      this.centre[1] += before[1] - after[1];
    }
    this.request();
  }

  /** What of the plane is seen: from where to where along x and y, and how much of it a pixel is. */
  window(): { x: [number, number]; y: [number, number]; pixel: number } {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    const corners = [[0, 0], [w, 0], [0, h], [w, h]].map(([x, y]) => this.at(x!, y!));
    const span = (a: 0 | 1): [number, number] => {
      const all = corners.map((p) => p[a] + this.origin[a]);
      return [Math.min(...all), Math.max(...all)];
    };
    return { x: span(0), y: span(1), pixel: this.pixel };
  }

  /** The point of the plane at a pixel, relative to `origin`. */
  private at(x: number, y: number): [number, number] {
    const dx = (x - this.canvas.clientWidth / 2) * this.pixel, dy = (this.canvas.clientHeight / 2 - y) * this.pixel;
    const c = Math.cos(this.angle), s = Math.sin(this.angle);
    return [this.centre[0] + (c * dx + s * dy) / this.shrunk, this.centre[1] - s * dx + c * dy];
  }

  private moved(event: PointerEvent): void {
    const before = this.pointers.get(event.pointerId);
    if (this.d === 2) {
      const [x, y] = this.at(event.offsetX, event.offsetY);
      this.where(x + this.origin[0], y + this.origin[1]);
    }
    if (!before) {
      const { offsetX: x, offsetY: y } = event;
      return this.mark(this.find(x, y), x, y);
    }
    this.mark(undefined, 0, 0);
    const now: [number, number] = [event.offsetX, event.offsetY], dx = now[0] - before[0], dy = now[1] - before[1];
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)![1];
      const apart = (p: [number, number]): number => Math.hypot(p[0] - other[0], p[1] - other[1]);
      if (apart(before) > 0) this.zoom(apart(now) / apart(before), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
      this.drag(dx / 2, dy / 2, this.d === 3);
    } else this.drag(dx, dy, event.shiftKey || event.buttons > 1);
    this.pointers.set(event.pointerId, now);
  }

  /** Rows x, y, z of the view as columns: from the world to the eye. */
  private rotation(): Float32Array {
    const c = Math.cos(this.yaw), s = Math.sin(this.yaw), d = Math.cos(this.pitch), e = Math.sin(this.pitch);
    return Float32Array.of(c, s * d, s * e, 0, -s, c * d, c * e, 0, 0, -e, d, 0, 0, 0, 0, 1);
  }

  /** Mark an isovalue, drawing it wider; none marks none. */
  mark(isovalue: number | undefined, x: number, y: number): void {
    this.pointed(isovalue, x, y);
    if (isovalue === this.marked) return;
    this.marked = isovalue;
    this.request(false);
  }

  /** The isovalue that is nearest to a pixel of the page, if one is near. */
  find(x: number, y: number): number | undefined {
    const { clientWidth: w, clientHeight: h } = this.canvas, ids = (this.ids ??= this.identified(w, h));
    let least = NEAR ** 2 + 1, found: number | undefined;
    for (let dy = -NEAR; dy <= NEAR; dy++) for (let dx = -NEAR; dx <= NEAR; dx++) {
      const u = Math.round(x) + dx, v = h - 1 - Math.round(y) - dy, far = dx * dx + dy * dy;
      if (u < 0 || v < 0 || u >= w || v >= h || far >= least) continue;
      const id = ids[4 * (v * w + u)]! + 256 * ids[4 * (v * w + u) + 1]!;
      if (id) [least, found] = [far, id - 1];
    }
    return found;
  }

  private identified(w: number, h: number): Uint8Array {
    const { gl, target } = this, ids = new Uint8Array(4 * w * h);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    for (const [buffer, format, point] of [[target.colour, gl.RGBA8, gl.COLOR_ATTACHMENT0], [target.depth, gl.DEPTH_COMPONENT16, gl.DEPTH_ATTACHMENT]] as const) {
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, w, h);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, point, gl.RENDERBUFFER, buffer);
    }
    gl.viewport(0, 0, w, h);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    for (const isovalue of this.parts.keys()) this.paint(isovalue, [((isovalue + 1) & 255) / 255, ((isovalue + 1) >> 8) / 255, 0, 1], true);
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, ids);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return ids;
  }

  draw(): void {
    const { gl, canvas, parts, marked } = this, ratio = devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    gl.viewport(0, 0, width, height);
    const back = this.dark ? [0.078, 0.094, 0.11] : [0.984, 0.984, 0.973];
    gl.clearColor(back[0]!, back[1]!, back[2]!, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    // surfaces from the inside out: the innermost is opaque, those around it are seen through; of curves the marked one is last
    const order = [...parts].sort(([i, p], [j, q]) => p.extent - q.extent || Number(i === marked) - Number(j === marked) || i - j);
    order.forEach(([isovalue, { drawing: { n } }], place) =>
      this.paint(isovalue, [...this.colours(isovalue), n === 3 && place && isovalue !== marked ? VEIL : 1], false));
  }

  /** Draw an isovalue in a colour, shaded unless it is to be told by it. */
  private paint(isovalue: number, colour: [number, number, number, number], told: boolean): void {
    const { gl, canvas } = this, { drawing: { n, d }, points, normals, index, count } = this.parts.get(isovalue)!;
    if (!count) return;
    const program = this.programs[d === 2 ? 0 : n === 3 && !told ? 1 : 2]!, at = (name: string): WebGLUniformLocation | null =>
      gl.getUniformLocation(program, name);
    gl.useProgram(program);
    gl.uniform4f(at("colour"), ...colour);
    gl.bindBuffer(gl.ARRAY_BUFFER, points);
    gl.enableVertexAttribArray(0);
    gl.disableVertexAttribArray(1);
    const [x, y, z] = this.centre, wide = 2 / (canvas.clientWidth * this.pixel), high = 2 / (canvas.clientHeight * this.pixel);
    if (d === 2) {
      const c = Math.cos(this.angle), s = Math.sin(this.angle), u = this.shrunk;
      gl.uniformMatrix3fv(at("camera"), false, [c * u * wide, s * u * high, 0, -s * wide, c * high, 0,
        (-c * u * x + s * y) * wide, (-s * u * x - c * y) * high, 1]);
      gl.uniform2f(at("size"), canvas.clientWidth, canvas.clientHeight);
      gl.uniform1f(at("wide"), (this.parts.size > 12 ? 1 : this.parts.size > 3 ? 1.1 : 1.6) + (isovalue === this.marked ? 1.2 : 0));
      gl.disable(gl.DEPTH_TEST);
      gl.disable(gl.BLEND);
      gl.vertexAttribPointer(0, 4, gl.FLOAT, false, 0, 0);
      gl.vertexAttribDivisor(0, 1);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
      return;
    }
    const v = this.rotation();
    for (let r = 0; r < 3; r++) v[12 + r] = -(v[r]! * x + v[4 + r]! * y + v[8 + r]! * z);
    const m = v.slice(), deep = 1 / (2 * this.extent), far = 0.25 * this.scale * deep;
    // a mild perspective: what is nearer by the size of the box is a quarter larger
    for (let i = 0; i < 16; i += 4) {
      const w = (i === 12 ? 1 : 0) - far * v[i + 2]!;
      m[i] = v[i]! * wide;
      m[i + 1] = v[i + 1]! * high;
      m[i + 2] = -v[i + 2]! * deep * 0.5;
      m[i + 3] = w;
    }
    gl.uniformMatrix4fv(at("camera"), false, m);
    gl.uniformMatrix4fv(at("view"), false, v);
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(colour[3] === 1);
    (colour[3] === 1 ? gl.disable : gl.enable).call(gl, gl.BLEND);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.vertexAttribDivisor(0, 0);
    if (normals) {
      gl.bindBuffer(gl.ARRAY_BUFFER, normals);
      gl.enableVertexAttribArray(1);
      gl.vertexAttribPointer(1, 3, gl.FLOAT, false, 0, 0);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, index!);
    gl.drawElements(n === 3 ? gl.TRIANGLES : gl.LINES, count, gl.UNSIGNED_INT, 0);
    gl.depthMask(true);
  }
}
