// Lines and marks in space: turned, moved and zoomed by mouse, fingers or keys; drawn only when something changes.
"use strict";

const VIEWS = { Oblique: [0.62, -0.68, 0.5], Top: [0, -1e-4, 1], Front: [0, -1, 0], Side: [1, 0, 0] };

// A disc, for marks that are round.
function disc() {
  const canvas = Object.assign(document.createElement("canvas"), { width: 64, height: 64 }), pen = canvas.getContext("2d");
  pen.fillStyle = "#fff";
  pen.arc(32, 32, 30, 0, 7);
  pen.fill();
  return new THREE.CanvasTexture(canvas);
}

class SpaceView {
  // stage: the element it fills; points: Float32Array xyz of all there is; shown: of them those that have to fit.
  constructor(stage, points, label, shown = points) {
    this.stage = stage;
    this.canvas = stage.appendChild(document.createElement("canvas"));
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${label}. Arrow keys turn it, plus and minus zoom.`);
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.scene = new THREE.Scene();
    this.camera = new THREE.OrthographicCamera();
    this.camera.up.set(0, 0, 1);
    this.shown = shown;
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    shown.forEach((value, i) => {
      if (Number.isFinite(value)) { low[i % 3] = Math.min(low[i % 3], value); high[i % 3] = Math.max(high[i % 3], value); }
    });
    this.centre = new THREE.Vector3(...low.map((value, i) => Number.isFinite(value) ? 0.5 * (value + high[i]) : 0));
    this.reach = 1e-6;
    for (let i = 0; i + 2 < points.length; i += 3) {
      const away = Math.hypot(points[i] - this.centre.x, points[i + 1] - this.centre.y, points[i + 2] - this.centre.z);
      if (away > this.reach) this.reach = away;
    }
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.draw());
    this.materials = [];
    this.tags = [];
    for (const axis of "xyz") this.tag(axis);
    this.axes = this.lines(new Float32Array(18), null, 1.5);
    const views = this.views = stage.appendChild(document.createElement("div"));
    views.className = "views";
    for (const [name, from] of Object.entries(VIEWS)) {
      const button = views.appendChild(document.createElement("button"));
      button.type = "button"; button.textContent = name;
      button.addEventListener("click", () => this.look(from));
    }
    this.canvas.addEventListener("keydown", event => this.key(event));
    new ResizeObserver(() => this.resize()).observe(stage);
    this.look(VIEWS.Oblique);
    this.resize();
  }

  tag(text, kind = "") {
    const element = this.stage.appendChild(document.createElement("span"));
    element.className = `tag ${kind}`; element.textContent = text; element.setAttribute("aria-hidden", "true");
    // The line from a label down to its place, behind all labels.
    const stem = kind === "mark" ? this.stage.insertBefore(document.createElement("i"), element) : null;
    if (stem) stem.className = "stem";
    this.tags.push({ element, stem, at: new THREE.Vector3() });
    return this.tags.at(-1);
  }

  // A label above its place, higher where another one stands already, all of it on the stage; below it where there is no room.
  placed(x, y, word, stem) {
    const { signs, stage: { clientWidth: width, clientHeight: height } } = this, wide = word.offsetWidth, high = word.offsetHeight;
    const left = Math.min(Math.max(x - wide / 2, 2), width - wide - 2);
    let top = y - high - 16;
    const taken = () => top < 2 || signs.some(one => left < one.left + one.wide + 3 && one.left < left + wide + 3
      && top < one.top + one.high + 3 && one.top < top + high + 3);
    while (taken() && top > 2) top -= high / 2;
    if (taken()) for (top = y + 12; taken() && top < height - high; top += high / 2);
    signs.push({ left, top, wide, high });
    stem.style.height = `${Math.max(y - top - high, 0)}px`;
    stem.style.transform = `translate(${left + Math.min(Math.max(x - left, 0), wide)}px, ${top + high}px)`;
    return [left, top];
  }

  // Segments as pairs of ends (6 numbers each); colours alike, null for one.
  lines(ends, colours, width, name) {
    const geometry = new THREE.LineSegmentsGeometry();
    geometry.setPositions(ends);
    if (colours) geometry.setColors(colours);
    const material = new THREE.LineMaterial({ linewidth: width, vertexColors: Boolean(colours), worldUnits: false });
    const object = new THREE.LineSegments2(geometry, material);
    object.frustumCulled = false;
    object.userData.colour = name;
    this.scene.add(object);
    this.materials.push(material);
    return object;
  }

  points(places, size, name) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(places, 3));
    const material = new THREE.PointsMaterial({ size: size * this.renderer.getPixelRatio(), sizeAttenuation: false, depthTest: false,
      map: this.disc ??= disc(), transparent: true, alphaTest: 0.4 });
    const object = new THREE.Points(geometry, material);
    object.frustumCulled = false; object.renderOrder = 2;
    object.userData.colour = name;
    this.scene.add(object);
    return object;
  }

  recolour() {
    this.renderer.setClearColor(new THREE.Color(colour("panel")));
    this.axes.material.color.set(colour("soft"));
    for (const object of this.scene.children)
      if (object.userData.colour) object.material.color.set(colour(object.userData.colour));
    this.draw();
  }

  look(from) {
    const direction = new THREE.Vector3(...from).normalize();
    this.camera.zoom = 1;
    this.controls.target.copy(this.centre);
    this.camera.position.copy(this.centre).addScaledVector(direction, 4 * this.reach);
    this.camera.near = 0.01 * this.reach; this.camera.far = 20 * this.reach;
    this.camera.lookAt(this.centre);
    this.fit();
    this.controls.update();
    this.draw();
  }

  // What has to fit fills the stage from this side.
  fit() {
    this.camera.updateMatrixWorld();
    const across = new THREE.Vector3(), up = new THREE.Vector3(), { shown, centre } = this;
    this.camera.matrixWorld.extractBasis(across, up, new THREE.Vector3());
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    for (let i = 0; i < shown.length; i += 3) {
      if (!Number.isFinite(shown[i])) continue;
      const [x, y, z] = [shown[i] - centre.x, shown[i + 1] - centre.y, shown[i + 2] - centre.z];
      [x * across.x + y * across.y + z * across.z, x * up.x + y * up.y + z * up.z].forEach((value, k) => {
        low[k] = Math.min(low[k], value); high[k] = Math.max(high[k], value);
      });
    }
    const [wide, tall] = low.map((value, k) => Number.isFinite(value) ? Math.max(0.5 * (high[k] - value), 1e-6) : 1);
    const shift = across.clone().multiplyScalar(Number.isFinite(low[0]) ? 0.5 * (low[0] + high[0]) : 0)
      .addScaledVector(up, Number.isFinite(low[1]) ? 0.5 * (low[1] + high[1]) : 0);
    this.camera.position.add(shift);
    this.controls.target.copy(centre).add(shift);
    this.half = [1.1 * wide, 1.2 * tall];
    this.resize();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.stage;
    if (!width || !height || !this.half) return;
    const high = Math.max(this.half[1], this.half[0] * height / width);
    Object.assign(this.camera, { left: -high * width / height, right: high * width / height, top: high, bottom: -high });
    this.camera.updateProjectionMatrix();
    this.renderer.setSize(width, height, false);
    for (const material of this.materials) material.resolution.set(width, height);
    this.draw();
  }

  key(event) {
    const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (turns) {
      const away = this.camera.position.clone().sub(this.controls.target), flat = Math.hypot(away.x, away.y);
      const round = Math.atan2(away.y, away.x) + 0.12 * turns[0], far = away.length();
      const up = Math.min(Math.max(Math.atan2(away.z, flat) - 0.12 * turns[1], -1.5), 1.5);
      this.camera.position.copy(this.controls.target).add(new THREE.Vector3(
        far * Math.cos(up) * Math.cos(round), far * Math.cos(up) * Math.sin(round), far * Math.sin(up)));
    } else if (event.key === "+" || event.key === "=") this.camera.zoom *= 1.2;
    else if (event.key === "-") this.camera.zoom /= 1.2;
    else return;
    event.preventDefault();
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.draw();
  }

  // Where a point of space is on the stage [px].
  onStage(x, y, z) {
    const p = new THREE.Vector3(x, y, z).project(this.camera);
    return [0.5 * (p.x + 1) * this.stage.clientWidth, 0.5 * (1 - p.y) * this.stage.clientHeight];
  }

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      // The directions of the axes, always in the lower right corner.
      const { clientWidth: width, clientHeight: height } = this.stage, scale = (this.camera.right - this.camera.left) / this.camera.zoom / width;
      const corner = new THREE.Vector3(1 - 110 / width, -1 + 110 / height, -0.2).unproject(this.camera), ends = [];
      this.tags.slice(0, 3).forEach((tag, i) => {
        const end = corner.clone(); end.setComponent(i, end.getComponent(i) + 42 * scale);
        ends.push(...corner, ...end);
        tag.at.copy(corner); tag.at.setComponent(i, tag.at.getComponent(i) + 52 * scale);
      });
      this.axes.geometry.setPositions(ends);
      const { offsetLeft: left, offsetTop: top, offsetWidth: wide, offsetHeight: high } = this.views;
      this.signs = [{ left, top, wide, high }];
      for (const { element, stem, at } of this.tags) {
        const [x, y] = this.onStage(at.x, at.y, at.z);
        element.style.transform = stem
          ? `translate(${this.placed(x, y, element, stem).map(Math.round).join("px, ")}px)` : `translate(${x}px, ${y}px) translate(-50%, -50%)`;
      }
      this.renderer.render(this.scene, this.camera);
    });
  }
}

function stageOf(figure, hint) {
  const live = figure.querySelector(".live"), stage = live.querySelector(".stage");
  if (!document.createElement("canvas").getContext("webgl2")) throw new Error("no WebGL 2");
  figure.classList.add("has-view");
  // Behind the stage: on a telephone it stands below, where it covers nothing of the picture.
  const words = document.createElement("p");
  words.className = "hint"; words.textContent = hint;
  stage.after(words);
  return stage;
}

const HINT = "Drag to turn, right button or two fingers to move, wheel to zoom.";

window.startScene = async (figure, data) => {
  const stage = stageOf(figure, HINT);
  const view = new SpaceView(stage, Float32Array.from(data.lines.flatMap(line => line.points.flat())), data.title);
  for (const line of data.lines) {
    const ends = [];
    for (let i = 1; i < line.points.length; i++) ends.push(...line.points[i - 1], ...line.points[i]);
    if (ends.length && line.width) view.lines(new Float32Array(ends), null, line.width, line.colour);
    if (line.dots) view.points(Float32Array.from(line.points.flat()), line.dots, line.colour);
  }
  view.recolour();
  themeChanged.add(() => view.recolour());
  figure.view = view;
};
