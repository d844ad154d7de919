/** Drawing with WebGL 2, and the camera: curves as segments of an even width, surfaces shaded by their facets. */
import type { Drawing } from "../../codec/js/src/draw.js";

const CURVES = `#version 300 es
in vec4 ends;
uniform mat3 camera;
uniform vec2 size;
void main() {
  vec2 p = (camera * vec3(ends.xy, 1.)).xy, q = (camera * vec3(ends.zw, 1.)).xy;
  vec2 way = (q - p) * size, along = length(way) > 0. ? normalize(way) : vec2(1., 0.);
  float side = gl_VertexID % 2 == 0 ? -1. : 1., end = gl_VertexID < 2 ? -1. : 1.;
  vec2 shift = (vec2(-along.y, along.x) * side + along * end) * 1.6 / size;
  gl_Position = vec4((end < 0. ? p : q) + shift, 0., 1.);
}`;

const CURVE_COLOUR = `#version 300 es
precision highp float;
uniform vec3 colour;
out vec4 result;
void main() { result = vec4(colour, 1.); }`;

const SURFACE = `#version 300 es
in vec3 position;
uniform mat4 camera;
uniform mat4 view;
out vec3 at;
void main() {
  at = (view * vec4(position, 1.)).xyz;
  gl_Position = camera * vec4(position, 1.);
}`;

const SURFACE_COLOUR = `#version 300 es
precision highp float;
in vec3 at;
uniform vec3 colour;
out vec4 result;
void main() {
  vec3 normal = normalize(cross(dFdx(at), dFdy(at)));
  float front = abs(dot(normal, normalize(vec3(-.3, .5, .8))));
  result = vec4(colour * (.3 + .7 * front) + .08 * pow(abs(normal.z), 24.), 1.);
}`;

type Vector = [number, number, number];

export class Scene {
  private readonly gl: WebGL2RenderingContext;
  private readonly programs: WebGLProgram[];
  private readonly buffer: WebGLBuffer;
  private readonly index: WebGLBuffer;
  /** Points of a cell, coordinates of a point. */
  private n = 2;
  private d = 2;
  private count = 0;
  private dark = false;
  private waiting = false;
  /** What is looked at, relative to `origin`, and how large; the turn in the plane; the view from which side. */
  private origin: Vector = [0, 0, 0];
  private centre: Vector = [0, 0, 0];
  private extent = 1;
  private scale = 1;
  private angle = 0;
  private yaw = 0.6;
  private pitch = -1.0;
  /** Called when the view has changed and is drawn. */
  viewed: () => void = () => undefined;
  private readonly pointers = new Map<number, [number, number]>();

  constructor(private readonly canvas: HTMLCanvasElement, private readonly where: (x: number, y: number) => void) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.gl = gl;
    this.programs = [this.program(CURVES, CURVE_COLOUR), this.program(SURFACE, SURFACE_COLOUR), this.program(SURFACE, CURVE_COLOUR)];
    this.buffer = gl.createBuffer()!;
    this.index = gl.createBuffer()!;
    new ResizeObserver(() => this.request()).observe(canvas);
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    });
    for (const name of ["pointerup", "pointercancel"] as const)
      canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => this.moved(event));
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
    gl.bindAttribLocation(program, 0, "ends");
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) ?? "no shader");
    return program;
  }

  /** Draw this from now on; 32 bits are precise enough relative to `origin`. */
  set({ n, d, points, cells }: Pick<Drawing, "n" | "d" | "cells"> & { points: Float64Array }): void {
    const { gl, origin } = this;
    this.n = n;
    this.d = d;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    if (d === 2) {
      const ends = new Float32Array(2 * cells.length);
      for (let i = 0; i < cells.length; i++) {
        ends[2 * i] = points[2 * cells[i]!]! - origin[0];
        ends[2 * i + 1] = points[2 * cells[i]! + 1]! - origin[1];
      }
      gl.bufferData(gl.ARRAY_BUFFER, ends, gl.DYNAMIC_DRAW);
      this.count = cells.length / 2;
    } else {
      gl.bufferData(gl.ARRAY_BUFFER, Float32Array.from(points, (x, i) => x - origin[i % 3]!), gl.DYNAMIC_DRAW);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.index);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, cells, gl.DYNAMIC_DRAW);
      this.count = cells.length;
    }
  }

  /** Show all of some points, of `n` coordinates; what is drawn has to be set again, relative to their middle. */
  fit(n: number, points: Float64Array): void {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    points.forEach((x, i) => {
      low[i % n] = Math.min(low[i % n]!, x);
      high[i % n] = Math.max(high[i % n]!, x);
    });
    this.origin = low.map((x, a) => (a < n ? (x + high[a]!) / 2 : 0)) as Vector;
    this.centre = [0, 0, 0];
    const sides = low.slice(0, n).map((x, a) => high[a]! - x);
    const aspect = this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight - 90);
    this.extent = n === 2 ? Math.max(sides[1]!, sides[0]! / aspect) || 1 : Math.hypot(...sides) || 1;
    this.scale = 1;
    this.angle = 0;
    this.yaw = 0.6;
    this.pitch = -1.0;
    this.request();
  }

  theme(dark: boolean): void {
    this.dark = dark;
    this.request();
  }

  request(): void {
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
        centre[0] -= (c * dx - s * dy) * pixel;
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
    return [this.centre[0] + c * dx + s * dy, this.centre[1] - s * dx + c * dy];
  }

  private moved(event: PointerEvent): void {
    const before = this.pointers.get(event.pointerId);
    if (this.d === 2) {
      const [x, y] = this.at(event.offsetX, event.offsetY);
      this.where(x + this.origin[0], y + this.origin[1]);
    }
    if (!before) return;
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

  draw(): void {
    const { gl, canvas, n, d } = this, ratio = devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    gl.viewport(0, 0, width, height);
    const back = this.dark ? [0.078, 0.094, 0.11] : [0.984, 0.984, 0.973];
    gl.clearColor(back[0]!, back[1]!, back[2]!, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (!this.count) return;
    const program = this.programs[d === 2 ? 0 : n === 3 ? 1 : 2]!, at = (name: string): WebGLUniformLocation | null =>
      gl.getUniformLocation(program, name);
    gl.useProgram(program);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.enableVertexAttribArray(0);
    const [x, y, z] = this.centre, wide = 2 / (canvas.clientWidth * this.pixel), high = 2 / (canvas.clientHeight * this.pixel);
    if (d === 2) {
      const c = Math.cos(this.angle), s = Math.sin(this.angle);
      gl.uniformMatrix3fv(at("camera"), false, [c * wide, s * high, 0, -s * wide, c * high, 0,
        (-c * x + s * y) * wide, (-s * x - c * y) * high, 1]);
      gl.uniform2f(at("size"), width / ratio, height / ratio);
      gl.uniform3f(at("colour"), ...(this.dark ? [0.42, 0.72, 0.94] : [0.086, 0.408, 0.659]) as Vector);
      gl.disable(gl.DEPTH_TEST);
      gl.vertexAttribPointer(0, 4, gl.FLOAT, false, 0, 0);
      gl.vertexAttribDivisor(0, 1);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.count);
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
    gl.uniform3f(at("colour"), ...(this.dark ? [0.62, 0.78, 0.9] : [0.5, 0.66, 0.8]) as Vector);
    gl.enable(gl.DEPTH_TEST);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.vertexAttribDivisor(0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.index);
    gl.drawElements(n === 3 ? gl.TRIANGLES : gl.LINES, this.count, gl.UNSIGNED_INT, 0);
  }
}
