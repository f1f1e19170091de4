"use strict";
// The world in three.js: floor, bodies, their paths, and the cameras with the picture in them. `World.show(frame)` sets
// everything to one frame. What no shot links to the rest stands in a place of its own, moved aside by its `offset`.

const BACKGROUND = 0x191d23;
const NOT_OBSERVED = 0x9a9aa2, STANDS = 0x46eb78;
const FRUSTUM_M = 0.9, IDLE_FRUSTUM_M = 0.45; // widths of the pictures of the active camera and of the others
const PATH_HALF_WIDTH_M = 0.018;
const SOLE_M = 0.03; // height of the toe base over the sole
const TOE_BASE = { 7: 10, 10: 10, 8: 11, 11: 11 };

class Body {
  constructor(recording, person, parent) {
    this.recording = recording;
    this.person = person;
    const offset = recording.places[person.place].offset;
    this.group = new THREE.Group();
    this.group.position.set(...offset);
    parent.add(this.group);
    this.materials = {
      observed: new THREE.MeshStandardMaterial({ color: person.color, roughness: 0.7 }),
      filled: new THREE.MeshStandardMaterial({ color: NOT_OBSERVED, roughness: 0.9, transparent: true, opacity: 0.55 }),
    };
    this.addMesh();
    this.addPath();
    this.discs = recording.contactJoints.map(() => {
      const disc = new THREE.Mesh(new THREE.CircleGeometry(0.1, 32), new THREE.MeshBasicMaterial({ color: STANDS }));
      this.group.add(disc);
      return disc;
    });
    this.label = labelOf(String(person.person), person.color, 0.027);
    this.group.add(this.label);
  }

  addMesh() {
    const { recording, person } = this;
    const { body, parents } = recording;
    const geometry = new THREE.BufferGeometry();
    const vertices = Float32Array.from(person.vertices, (value) => value * person.scale);
    geometry.setAttribute("position", new THREE.BufferAttribute(vertices, 3));
    geometry.setAttribute("skinIndex", new THREE.BufferAttribute(body.joint, 4));
    geometry.setAttribute("skinWeight", new THREE.BufferAttribute(body.weight, 4, true));
    geometry.setIndex(new THREE.BufferAttribute(body.faces, 1));
    geometry.computeVertexNormals();
    const rest = person.restJoints.map((joint) => new THREE.Vector3(...joint));
    this.bones = rest.map((joint, index) => {
      const bone = new THREE.Bone();
      if (index > 0) bone.position.subVectors(joint, rest[parents[index]]);
      return bone;
    });
    this.bones.forEach((bone, index) => (index === 0 ? this.group : this.bones[parents[index]]).add(bone));
    const toJoint = rest.map((joint) => new THREE.Matrix4().makeTranslation(-joint.x, -joint.y, -joint.z));
    this.mesh = new THREE.SkinnedMesh(geometry, this.materials.observed);
    this.mesh.bind(new THREE.Skeleton(this.bones, toJoint), new THREE.Matrix4());
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.mesh.frustumCulled = false;
    this.group.add(this.mesh);
  }

  // The path of the root: a ribbon on the floor, faint before it is walked and dashed where it was filled in.
  addPath() {
    const { person } = this;
    const corners = new Float32Array(person.count * 6), index = [];
    this.pathEnd = new Uint32Array(person.count);
    for (let row = 0; row < person.count; row++) {
      const [x, y] = person.root(row);
      const [ax, ay] = person.root(Math.max(row - 1, 0)), [bx, by] = person.root(Math.min(row + 1, person.count - 1));
      const length = Math.hypot(bx - ax, by - ay) || 1;
      const nx = (-(by - ay) / length) * PATH_HALF_WIDTH_M, ny = ((bx - ax) / length) * PATH_HALF_WIDTH_M;
      corners.set([x + nx, y + ny, 0, x - nx, y - ny, 0], row * 6);
      if (row > 0 && (person.observed[row] || row % 4 < 2)) {
        const k = 2 * row;
        index.push(k - 2, k - 1, k, k, k - 1, k + 1);
      }
      this.pathEnd[row] = index.length;
    }
    const ribbon = (opacity, height) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
      geometry.setIndex(index);
      const look = { color: person.color, transparent: true, opacity, side: THREE.DoubleSide, depthWrite: false };
      const mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial(look));
      mesh.position.z = height;
      mesh.renderOrder = 2;
      this.group.add(mesh);
      return geometry;
    };
    ribbon(0.22, 0.006);
    this.walked = ribbon(0.9, 0.008);
  }

  // `labelled`: with the number over the head.
  show(frame, labelled) {
    const { person, bones } = this;
    const row = person.row(frame);
    this.group.visible = person.shown;
    for (const part of [this.mesh, this.label, ...this.discs]) part.visible = row >= 0 && person.shown;
    this.label.visible &&= labelled;
    this.walked.setDrawRange(0, row >= 0 ? this.pathEnd[row] : frame < person.first ? 0 : Infinity);
    if (row < 0) return;
    bones[0].position.fromArray(person.root(row));
    const scale = person.turnScale;
    for (let joint = 0; joint < bones.length; joint++) {
      const at = 4 * (row * bones.length + joint);
      const [x, y, z, w] = person.turns.subarray(at, at + 4);
      bones[joint].quaternion.set(x * scale, y * scale, z * scale, w * scale).normalize();
    }
    this.group.updateWorldMatrix(true, true);
    this.mesh.material = person.observed[row] ? this.materials.observed : this.materials.filled;
    const joints = this.joints();
    this.recording.contactJoints.forEach((joint, foot) => {
      const disc = this.discs[foot];
      disc.visible &&= person.stands(row, foot) && person.observed[row] === 1;
      disc.position.set(joints[joint].x, joints[joint].y, Math.max(0, joints[TOE_BASE[joint]].z - SOLE_M) + 0.004);
    });
    this.label.position.copy(joints[15]).z += 0.34;
  }

  // Joints as motion.zarr has them: metres, without the offset of the place.
  joints() {
    const offset = this.group.position;
    return this.bones.map((bone) => new THREE.Vector3().setFromMatrixPosition(bone.matrixWorld).sub(offset));
  }
}

// The pyramid of a shot's camera, and its picture.
class ShotCamera {
  constructor(recording, index, parent, video) {
    this.recording = recording;
    this.shot = recording.shots[index];
    this.offset = recording.places[this.shot.place].offset;
    this.lines = new THREE.LineSegments(
      new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(new Float32Array(20 * 3), 3)),
      new THREE.LineBasicMaterial({ color: this.shot.color }),
    );
    this.lines.frustumCulled = false;
    parent.add(this.lines);
    this.label = labelOf(String(index), this.shot.color, 0.022);
    parent.add(this.label);
    if (!video) return;
    const corners = new THREE.BufferGeometry();
    corners.setAttribute("position", new THREE.BufferAttribute(new Float32Array(4 * 3), 3));
    corners.setAttribute("uv", new THREE.BufferAttribute(new Float32Array([0, 1, 1, 1, 1, 0, 0, 0]), 2));
    corners.setIndex([0, 3, 1, 1, 3, 2]);
    const look = { map: video, side: THREE.DoubleSide, transparent: true };
    this.picture = new THREE.Mesh(corners, new THREE.MeshBasicMaterial(look));
    this.picture.frustumCulled = false;
    parent.add(this.picture);
  }

  // `through`: the world is seen through this camera, so that its picture is what lies behind everything.
  show(frame, active, through, pictureShown) {
    const at = Math.max(this.shot.start, Math.min(this.shot.end - 1, frame));
    const corners = this.corners(at, active ? FRUSTUM_M : IDLE_FRUSTUM_M);
    const [c, a, b, d, e] = corners;
    const up = a.clone().lerp(b, 0.5).add(a.clone().sub(e).multiplyScalar(0.18)); // a triangle over the upper edge
    const ends = [c, a, c, b, c, d, c, e, a, b, b, d, d, e, e, a, a, up, up, b];
    const position = this.lines.geometry.attributes.position;
    ends.forEach((end, i) => position.setXYZ(i, end.x, end.y, end.z));
    position.needsUpdate = true;
    this.lines.material.color.set(this.shot.color).multiplyScalar(active ? 1.5 : 0.7);
    this.lines.visible = this.label.visible = !(active && through);
    this.label.position.copy(c).z += 0.16;
    if (!this.picture) return;
    this.picture.visible = active && pictureShown;
    [a, b, d, e].forEach((corner, i) => this.picture.geometry.attributes.position.setXYZ(i, corner.x, corner.y, corner.z));
    this.picture.geometry.attributes.position.needsUpdate = true;
    this.picture.material.depthTest = this.picture.material.depthWrite = !through;
    this.picture.renderOrder = through ? -10 : 0;
  }

  // Centre, and upper left, upper right, lower right, lower left corner of the picture at a width in metres.
  corners(frame, width) {
    const { K, R, t, width: W, height: H } = this.recording;
    const [fx, , cx, , fy, cy] = K.subarray(9 * frame, 9 * frame + 6);
    const r = R.subarray(9 * frame, 9 * frame + 9), depth = (width * fx) / W;
    const center = new THREE.Vector3(...t.subarray(3 * frame, 3 * frame + 3)).add(new THREE.Vector3(...this.offset));
    const corner = (u, v) => {
      const x = ((u - cx) / fx) * depth, y = ((v - cy) / fy) * depth;
      const ray = [0, 3, 6].map((row) => r[row] * x + r[row + 1] * y + r[row + 2] * depth);
      return new THREE.Vector3(...ray).add(center);
    };
    return [center, corner(0, 0), corner(W, 0), corner(W, H), corner(0, H)];
  }
}

class World {
  constructor(recording, canvas, video) {
    this.recording = recording;
    this.renderer = new THREE.WebGLRenderer({ canvas, context: canvas.getContext("webgl2") });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(BACKGROUND);
    this.pictureShown = true;
    if (video) {
      this.picture = new THREE.VideoTexture(video);
      this.picture.colorSpace = THREE.SRGBColorSpace;
    }
    this.addLight();
    this.addFloor();
    this.bodies = recording.people.map((person) => new Body(recording, person, this.scene));
    this.cameras = recording.shots.map((_, index) => new ShotCamera(recording, index, this.scene, this.picture));
    this.signs = recording.places.slice(1).map((place) => {
      const sign = labelOf(`apart: ${place.title}`, 0xffb454, 0.024);
      sign.position.set(place.offset[0] + place.center[0], place.offset[1] + place.center[1], 0);
      this.scene.add(sign);
      return sign;
    });
  }

  addLight() {
    this.scene.add(new THREE.HemisphereLight(0xf2f6ff, 0x6a645c, 2.1));
    this.sun = new THREE.DirectionalLight(0xfff3e0, 2.8);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    Object.assign(this.sun.shadow.camera, { left: -4, right: 4, top: 4, bottom: -4, near: 0.5, far: 25 });
    this.sun.shadow.normalBias = 0.05;
    this.sun.shadow.radius = 3;
    this.scene.add(this.sun, this.sun.target);
  }

  // A grid of metres that fades with the distance from the eye, and what catches the shadows.
  addFloor() {
    const plane = new THREE.PlaneGeometry(400, 400);
    const grid = new THREE.ShaderMaterial({
      transparent: true, depthWrite: false, side: THREE.DoubleSide, vertexShader: FLOOR_VERTEX, fragmentShader: FLOOR_GRID,
    });
    this.floor = new THREE.Mesh(plane, grid);
    this.floor.renderOrder = -2;
    const shadow = new THREE.Mesh(plane, new THREE.ShadowMaterial({ opacity: 0.42, depthWrite: false }));
    shadow.receiveShadow = true;
    shadow.renderOrder = -1;
    shadow.position.z = 0.002;
    this.scene.add(this.floor, shadow);
  }

  // Set everything to a frame; `through`: the eye is the shot's camera.
  show(frame, through) {
    for (const body of this.bodies) body.show(frame, !(through && this.pictureShown)); // the picture has numbers
    const active = this.recording.shotOf[frame];
    this.cameras.forEach((camera, index) => camera.show(frame, index === active, through, this.pictureShown));
    this.signs.forEach((sign, index) => {
      sign.visible = !through;
      sign.material.opacity = this.recording.shotAt(frame).place === index + 1 ? 1 : 0.35;
    });
    const center = this.center(frame);
    this.sun.target.position.copy(center);
    this.sun.position.copy(center).add(new THREE.Vector3(-3.5, -4.5, 9));
    if (this.picture) this.picture.needsUpdate = true;
  }

  // Between the people who are shown in a frame's place.
  center(frame) {
    const place = this.recording.shotAt(frame).place;
    const roots = this.bodies
      .filter(({ person }) => person.shown && person.place === place && person.row(frame) >= 0)
      .map(({ person, group }) => new THREE.Vector3(...person.root(person.row(frame))).add(group.position));
    if (roots.length === 0) {
      const { offset, center } = this.recording.places[place];
      return new THREE.Vector3(offset[0] + center[0], offset[1] + center[1], 0);
    }
    const middle = roots.reduce((sum, root) => sum.add(root), new THREE.Vector3()).divideScalar(roots.length);
    middle.z = 0;
    return middle;
  }

  draw(eye) {
    this.renderer.render(this.scene, eye);
  }
}

const FLOOR_VERTEX = `
  varying vec3 at;
  void main() {
    at = (modelMatrix * vec4(position, 1.0)).xyz;
    gl_Position = projectionMatrix * viewMatrix * vec4(at, 1.0);
  }`;
const FLOOR_GRID = `
  varying vec3 at;
  float lines(float spacing, float width) {
    vec2 cell = at.xy / spacing, fine = fwidth(cell);
    vec2 off = abs(fract(cell - 0.5) - 0.5) / max(fine, 1e-6);
    return (1.0 - min(min(off.x, off.y) / width, 1.0)) * (1.0 - smoothstep(0.25, 0.6, max(fine.x, fine.y)));
  }
  void main() {
    float far = length(cameraPosition.xy - at.xy) + abs(cameraPosition.z);
    float fade = exp(-far / 22.0);
    float fine = lines(1.0, 1.1) * 0.16, coarse = lines(5.0, 1.4) * 0.26;
    gl_FragColor = vec4(mix(vec3(0.42, 0.46, 0.52), vec3(0.9), max(fine, coarse)), (0.18 + max(fine, coarse)) * fade);
  }`;

// Text that always faces the eye, equally large near and far: `height` in parts of what the eye sees at a metre.
function labelOf(text, color, height) {
  const canvas = document.createElement("canvas"), size = 48;
  const context = canvas.getContext("2d");
  const font = `bold ${size}px system-ui, sans-serif`;
  context.font = font;
  canvas.width = Math.ceil(context.measureText(text).width) + size * 0.7;
  canvas.height = size * 1.35;
  context.font = font;
  context.fillStyle = new THREE.Color(color).getStyle();
  context.beginPath();
  context.roundRect(0, 0, canvas.width, canvas.height, size * 0.3);
  context.fill();
  context.fillStyle = "#121418";
  context.fillText(text, size * 0.35, size * 1.05);
  const texture = new THREE.CanvasTexture(canvas);
  texture.colorSpace = THREE.SRGBColorSpace;
  const look = { map: texture, depthTest: false, transparent: true, sizeAttenuation: false };
  const label = new THREE.Sprite(new THREE.SpriteMaterial(look));
  label.scale.set((height * canvas.width) / canvas.height, height, 1);
  label.renderOrder = 5;
  return label;
}
