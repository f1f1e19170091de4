"use strict";
// From where the world is seen: freely, through the shot's camera, from two sides, from above, or following a person.

const MODES = ["free", "shot", "side", "other side", "top", "follow"];
const FIELD_DEG = 36;
const UP = new THREE.Vector3(0, 0, 1);
const NEAR_M = 9; // cameras nearer than this to the middle of the people are in the free view
const FOLLOW_S = 0.6; // the followed root is averaged over so many seconds

class Views {
  constructor(recording, world, canvas) {
    this.recording = recording;
    this.world = world;
    this.canvas = canvas;
    this.eye = new THREE.PerspectiveCamera(FIELD_DEG, 1, 0.05, 500);
    this.eye.up.copy(UP);
    this.lens = new THREE.PerspectiveCamera(); // the shot's camera: its matrices are set by hand
    this.lens.matrixAutoUpdate = false;
    this.controls = new THREE.OrbitControls(this.eye, canvas);
    this.controls.maxPolarAngle = Math.PI * 0.55;
    this.mode = "free";
    this.followed = 0;
  }

  get camera() {
    return this.mode === "shot" ? this.lens : this.eye;
  }

  choose(mode, frame) {
    this.mode = mode;
    this.controls.enabled = mode !== "shot";
    this.place = this.recording.shotAt(frame).place;
    const box = this.boxOf(this.paths(frame, mode === "free"));
    const direction = this.directionOf(mode, frame, box.along);
    if (direction) this.fit(box, direction, mode === "top");
    if (mode === "follow") this.startFollowing(frame);
    this.show(frame);
  }

  resize(width, height) {
    this.width = width;
    this.height = height;
    this.eye.aspect = width / height;
    this.eye.updateProjectionMatrix();
  }

  show(frame) {
    if (this.recording.shotAt(frame).place !== this.place) return this.choose(this.mode, frame);
    if (this.mode === "shot") return this.lookThrough(frame);
    if (this.mode === "follow") {
      const root = this.smoothRoot(frame);
      if (root) this.moveTo(root);
    }
    this.controls.update();
    this.eye.updateMatrixWorld();
    return undefined;
  }

  // From the middle of the people to the eye: across the main direction in which they move; freely, from behind the shot's
  // camera, a little to its side.
  directionOf(mode, frame, along) {
    if (mode === "top") return new THREE.Vector3(0, -0.001, 1).normalize();
    if (mode === "free") {
      const r = this.recording.R.subarray(9 * frame, 9 * frame + 9);
      const back = new THREE.Vector3(-r[2], -r[5], 0);
      if (back.length() < 0.1) back.set(0, -1, 0);
      return back.normalize().applyAxisAngle(UP, 0.65).setZ(0.42).normalize();
    }
    const side = { side: 1, "other side": -1 }[mode];
    return side && new THREE.Vector3(side * along.y, -side * along.x, 0.12).normalize();
  }

  fit({ center, along, half }, direction, above) {
    const right = new THREE.Vector3(-direction.y, direction.x, 0).normalize();
    const ahead = Math.abs(right.x * along.x + right.y * along.y), aside = Math.sqrt(Math.max(0, 1 - ahead * ahead));
    const wide = above ? half.x : ahead * half.length + aside * half.depth;
    const deep = above ? 2 : aside * half.length + ahead * half.depth + 0.4;
    const tan = Math.tan((FIELD_DEG * Math.PI) / 360);
    const distance = Math.max(wide / (tan * this.eye.aspect), (above ? half.y : 1.15) / tan, 2.2) + 0.6 * deep;
    this.controls.target.copy(center);
    this.eye.position.copy(center).addScaledVector(direction, distance * 1.08);
    this.controls.update();
  }

  // Points of the paths on the floor of those who are shown in this place, if so wished with the cameras.
  paths(frame, withCameras) {
    const place = this.recording.shotAt(frame).place, points = [];
    for (const { person, group } of this.world.bodies) {
      if (!person.shown || person.place !== place) continue;
      const step = Math.max(1, Math.floor(person.count / 400));
      for (let row = 0; row < person.count; row += step) {
        const [x, y] = person.root(row);
        points.push([x + group.position.x, y + group.position.y]);
      }
    }
    const { offset, center } = this.recording.places[place];
    const middle = [offset[0] + center[0], offset[1] + center[1]];
    if (points.length === 0) points.push(middle);
    for (const shot of withCameras ? this.recording.shots : []) {
      const [x, y] = this.recording.t.subarray(3 * shot.start, 3 * shot.start + 2);
      const near = Math.hypot(x - center[0], y - center[1]) < NEAR_M;
      if (shot.place === place && near) points.push([x + offset[0], y + offset[1]]);
    }
    return points;
  }

  // Middle, main direction and half sizes of points on the floor, with room for a body.
  boxOf(points) {
    const middle = [0, 1].map((k) => points.reduce((sum, point) => sum + point[k], 0) / points.length);
    let xx = 1e-6, xy = 0, yy = 0;
    for (const [x, y] of points) {
      xx += (x - middle[0]) ** 2;
      xy += (x - middle[0]) * (y - middle[1]);
      yy += (y - middle[1]) ** 2;
    }
    const angle = 0.5 * Math.atan2(2 * xy, xx - yy);
    const along = new THREE.Vector3(Math.cos(angle), Math.sin(angle), 0);
    const spans = (project) => {
      const values = points.map(project);
      return [Math.min(...values), Math.max(...values)];
    };
    const [a0, a1] = spans(([x, y]) => x * along.x + y * along.y), [b0, b1] = spans(([x, y]) => y * along.x - x * along.y);
    const [x0, x1] = spans(([x]) => x), [y0, y1] = spans(([, y]) => y);
    const a = (a0 + a1) / 2, b = (b0 + b1) / 2;
    const center = new THREE.Vector3(a * along.x - b * along.y, a * along.y + b * along.x, 0.95);
    const body = 0.8;
    const half = {
      length: (a1 - a0) / 2 + body, depth: (b1 - b0) / 2 + body, x: (x1 - x0) / 2 + body, y: (y1 - y0) / 2 + body,
    };
    return { center, along, half };
  }

  // ---- following

  startFollowing(frame) {
    const root = this.smoothRoot(frame);
    if (!root) return;
    const back = this.eye.position.clone().sub(this.controls.target);
    if (back.z > 0.7 * back.length()) back.copy(this.directionOf("free", frame)); // seen from above so far
    back.setLength(4.5);
    this.controls.target.copy(root);
    this.eye.position.copy(root).add(back);
    this.controls.update();
  }

  moveTo(root) {
    const step = root.clone().sub(this.controls.target);
    this.controls.target.add(step);
    this.eye.position.add(step);
  }

  smoothRoot(frame) {
    const body = this.world.bodies[this.followed];
    if (!body) return null;
    const { person } = body, { time } = this.recording;
    const middle = Math.max(person.first, Math.min(person.first + person.count - 1, frame));
    const sum = new THREE.Vector3();
    let count = 0;
    for (let way of [-1, 1]) {
      for (let at = way < 0 ? middle : middle + 1; person.row(at) >= 0; at += way) {
        if (Math.abs(time[at] - time[middle]) > FOLLOW_S / 2) break;
        const [x, y] = person.root(person.row(at));
        sum.x += x;
        sum.y += y;
        count++;
      }
    }
    sum.divideScalar(count).add(body.group.position);
    sum.z = 0.95;
    return sum;
  }

  // ---- the shot's camera

  // Pixels of the canvas per pixel of the video: the whole picture is in view.
  get scale() {
    return Math.min(this.width / this.recording.width, this.height / this.recording.height);
  }

  lookThrough(frame) {
    const { R, t, K, width: W, height: H } = this.recording;
    const [fx, skew, cx, , fy, cy] = K.subarray(9 * frame, 9 * frame + 6), r = R.subarray(9 * frame, 9 * frame + 9);
    const offset = this.recording.placeAt(frame).offset, at = t.subarray(3 * frame, 3 * frame + 3);
    const x = (2 * this.scale) / this.width, y = (2 * this.scale) / this.height, near = 0.05, far = 500;
    const { lens } = this;
    lens.projectionMatrix.set(
      fx * x, -skew * x, -(cx - W / 2) * x, 0,
      0, fy * y, (cy - H / 2) * y, 0,
      0, 0, -(far + near) / (far - near), (-2 * far * near) / (far - near),
      0, 0, -1, 0,
    );
    lens.projectionMatrixInverse.copy(lens.projectionMatrix).invert();
    lens.matrix.set( // camera axes x right, y down, z forward become x right, y up, z back
      r[0], -r[1], -r[2], at[0] + offset[0],
      r[3], -r[4], -r[5], at[1] + offset[1],
      r[6], -r[7], -r[8], at[2] + offset[2],
      0, 0, 0, 1,
    );
    lens.matrixWorldNeedsUpdate = true;
    lens.updateMatrixWorld(true);
  }

  // Where a point of the world is on the canvas, in CSS pixels; null behind the eye.
  onCanvas(point) {
    const seen = point.clone().applyMatrix4(this.camera.matrixWorldInverse);
    if (seen.z > -0.05) return null;
    seen.applyMatrix4(this.camera.projectionMatrix);
    return [((seen.x + 1) / 2) * this.width, ((1 - seen.y) / 2) * this.height];
  }

  // The same in pixels of the video, when the eye is the shot's camera.
  inVideo(point) {
    const on = this.onCanvas(point);
    if (!on) return null;
    const { width: W, height: H } = this.recording;
    return [(on[0] - this.width / 2) / this.scale + W / 2, (on[1] - this.height / 2) / this.scale + H / 2];
  }
}
