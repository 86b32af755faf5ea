// SPDX-License-Identifier: BSD-3-Clause
// The robot in 3-D, by three.js (r111 or newer, as a script that defines THREE).

// One camera for all views, so that runs can be compared. Angles in rad, z up.
const orbit = { target: [0, 0, 0], distance: 5, azimuth: 0, elevation: 0, set: false };

class View {
  // `changed` is called when the user moved the camera.
  constructor(element, run, zDown, changed) {
    this.run = run;
    this.parts = [];
    this.element = element;
    try {
      if (typeof THREE === "undefined") throw new Error("three.js was not found when this page was written");
      this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
    } catch (error) {
      const reason = typeof THREE === "undefined" ? error.message : "this browser has no WebGL";
      element.insertAdjacentHTML("beforeend", `<p class="missing">No 3-D picture: ${reason}. All else works.</p>`);
      return;
    }
    element.append(this.renderer.domElement);
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.camera = new THREE.PerspectiveCamera(38, 1, 0.02, 500);
    this.scene = new THREE.Scene();
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8fa3b0, 0.85));
    const sun = new THREE.DirectionalLight(0xffffff, 0.55);
    sun.position.set(3, 8, 5);
    this.scene.add(sun);
    this.world = new THREE.Group();
    this.world.rotation.x = zDown ? Math.PI / 2 : -Math.PI / 2;
    this.scene.add(this.world);
    for (const shape of run.shapes) this.add(shape);
    if (!orbit.set) this.frameAll(zDown);
    this.listen(changed);
  }

  add(shape) {
    const make = this[`make_${shape.shape}`];
    if (!make) return;
    const material = new THREE.MeshPhongMaterial({
      color: shape.color, shininess: 25, transparent: shape.opacity < 1, opacity: shape.opacity,
      depthWrite: shape.opacity === 1, side: shape.shape === "cone" ? THREE.DoubleSide : THREE.FrontSide,
    });
    const object = make.call(this, shape, material);
    this.world.add(object);
    this.parts.push({ shape, object });
  }
  // A mesh at the shape's place in its frame.
  placed(shape, ...meshes) {
    const group = new THREE.Group(), inner = new THREE.Group();
    const [x, y, z, ...q] = shape.at;
    inner.position.set(x, y, z);
    inner.quaternion.set(...q);
    inner.add(...meshes);
    group.add(inner);
    return group;
  }
  make_box(shape, material) {
    const mesh = new THREE.Mesh(new THREE.BoxGeometry(...shape.size), material);
    const edges = new THREE.LineSegments(new THREE.EdgesGeometry(mesh.geometry),
      new THREE.LineBasicMaterial({ color: 0x33475b, transparent: true, opacity: 0.5 }));
    return this.placed(shape, mesh, edges);
  }
  make_sphere(shape, material) {
    return this.placed(shape, new THREE.Mesh(new THREE.SphereGeometry(shape.size[0], 28, 20), material));
  }
  make_cylinder(shape, material) { // along z
    const geometry = new THREE.CylinderGeometry(shape.size[0], shape.size[0], shape.size[1], 28);
    geometry.rotateX(Math.PI / 2);
    return this.placed(shape, new THREE.Mesh(geometry, material));
  }
  make_capsule(shape, material) { // along z
    const [radius, length] = shape.size;
    const group = this.make_cylinder(shape, material);
    for (const end of [-0.5, 0.5]) {
      const cap = new THREE.Mesh(new THREE.SphereGeometry(radius, 20, 14), material);
      cap.position.z = end * length;
      group.children[0].add(cap);
    }
    return group;
  }
  make_cone(shape, material) { // half angle, length; opens along z
    const [angle, length] = shape.size;
    const geometry = new THREE.ConeGeometry(length * Math.tan(angle), length, 40, 1, true);
    geometry.translate(0, -length / 2, 0);
    geometry.rotateX(-Math.PI / 2);
    return this.placed(shape, new THREE.Mesh(geometry, material));
  }
  make_axes(shape) {
    const length = shape.size[0];
    const bars = [0xd1495b, 0x3a9d5d, 0x2f6fb3].map((color, axis) => {
      const geometry = new THREE.CylinderGeometry(length / 28, length / 28, length, 10);
      geometry.translate(0, length / 2, 0);
      if (axis === 0) geometry.rotateZ(-Math.PI / 2);
      if (axis === 2) geometry.rotateX(Math.PI / 2);
      return new THREE.Mesh(geometry, new THREE.MeshPhongMaterial({ color }));
    });
    return this.placed(shape, ...bars);
  }
  make_bone(shape, material) { // from the frame to another
    const radius = shape.size[0];
    const group = new THREE.Group();
    group.add(new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, 1, 20), material));
    group.add(new THREE.Mesh(new THREE.SphereGeometry(1.25 * radius, 20, 14), material));
    return group;
  }
  make_path(shape) {
    const line = (opacity) => new THREE.Line(new THREE.BufferGeometry(),
      new THREE.LineBasicMaterial({ color: shape.color, transparent: true, opacity }));
    const group = new THREE.Group();
    group.add(line(0.3), line(1));
    return group;
  }
  make_ground(shape) { // a grid at its place, squares of 1 m
    const size = shape.size[0];
    const grid = new THREE.GridHelper(size, Math.max(1, Math.round(size)), 0x7f97a5, 0xa9bdc8);
    grid.rotation.x = Math.PI / 2;
    return this.placed(shape, grid);
  }

  update(time) {
    if (!this.renderer) return;
    for (const { shape, object } of this.parts) {
      if (shape.shape === "path") this.updatePath(shape, object, time);
      else if (shape.shape === "bone") this.updateBone(shape, object, time);
      else if (shape.frame) {
        const pose = this.run.pose(shape.frame, time);
        object.visible = pose !== null;
        if (!pose) continue;
        object.position.set(...pose.p);
        object.quaternion.set(...pose.q);
      }
    }
    this.render();
  }
  updateBone(shape, object, time) {
    const from = this.run.pose(shape.frame, time), to = this.run.pose(shape.to, time);
    object.visible = Boolean(from && to) && Math.hypot(...from.p.map((x, k) => x - to.p[k])) > 1e-6;
    if (!object.visible) return;
    const a = new THREE.Vector3(...from.p), b = new THREE.Vector3(...to.p);
    const along = b.clone().sub(a), length = along.length();
    object.position.copy(a.add(b).multiplyScalar(0.5));
    object.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.multiplyScalar(1 / length));
    const [bar, joint] = object.children;
    bar.scale.y = length;
    joint.position.y = -length / 2;
  }
  updatePath(shape, object, time) {
    const channel = this.run.channels.get(shape.frame);
    if (!channel) return;
    const count = this.run.times.length;
    if (object.userData.count !== count) {
      object.userData.count = count;
      const points = new Float32Array(3 * count);
      let filled = 0;
      object.userData.upTo = []; // how many points at sample i
      for (let i = 0; i < count; ++i) {
        if (!isNaN(channel.columns[0][i])) {
          for (let k = 0; k < 3; ++k) points[3 * filled + k] = channel.columns[k][i];
          ++filled;
        }
        object.userData.upTo.push(filled);
      }
      for (const line of object.children) {
        line.geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
        line.geometry.setDrawRange(0, filled);
        line.frustumCulled = false;
      }
    }
    const { index } = this.run.place(time);
    object.children[1].geometry.setDrawRange(0, index < 0 ? 0 : object.userData.upTo[index]);
  }

  // Everything that moves, at any time, is in the picture.
  frameAll(zDown) {
    const least = [Infinity, Infinity, Infinity], most = [-Infinity, -Infinity, -Infinity];
    const take = (k, x, r) => {
      least[k] = Math.min(least[k], x - r);
      most[k] = Math.max(most[k], x + r);
    };
    for (const shape of this.run.shapes) {
      const channel = this.run.channels.get(shape.frame);
      const reach = shape.shape === "box" ? Math.max(...shape.size) / 2 : 0.1;
      for (let k = 0; k < 3; ++k) {
        if (channel) for (const x of channel.columns[k]) if (!isNaN(x)) take(k, x, reach);
        if (!channel && shape.shape !== "ground") take(k, shape.at[k], reach);
      }
    }
    if (!isFinite(least[0])) return;
    const [x, y, z] = [0, 1, 2].map((k) => (least[k] + most[k]) / 2);
    orbit.target = zDown ? [x, -z, y] : [x, z, -y];
    orbit.distance = 1.25 * Math.hypot(...[0, 1, 2].map((k) => most[k] - least[k])) + 0.3;
    orbit.set = true;
  }
  render() {
    if (!this.renderer) return;
    const { clientWidth: width, clientHeight: height } = this.element;
    if (this.width !== width || this.height !== height) {
      this.renderer.setSize(width, height, false);
      [this.width, this.height] = [width, height];
    }
    this.camera.aspect = width / Math.max(height, 1);
    this.camera.updateProjectionMatrix();
    const flat = Math.cos(orbit.elevation) * orbit.distance;
    this.camera.position.set(
      orbit.target[0] + flat * Math.cos(orbit.azimuth),
      orbit.target[1] + Math.sin(orbit.elevation) * orbit.distance,
      orbit.target[2] - flat * Math.sin(orbit.azimuth));
    this.camera.lookAt(...orbit.target);
    this.renderer.render(this.scene, this.camera);
  }
  // Left drag turns, right drag or shift moves, the wheel comes closer.
  listen(changed) {
    const canvas = this.element;
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons) return;
      if (event.buttons === 1 && !event.shiftKey) {
        orbit.azimuth -= event.movementX * 0.008;
        orbit.elevation = Math.max(-1.5, Math.min(1.5, orbit.elevation + event.movementY * 0.008));
      } else {
        const step = (orbit.distance / canvas.clientHeight) * 0.7;
        const matrix = this.camera.matrixWorld.elements; // columns: right, up
        for (let k = 0; k < 3; ++k) {
          orbit.target[k] += step * (event.movementY * matrix[4 + k] - event.movementX * matrix[k]);
        }
      }
      changed();
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      orbit.distance = Math.max(0.1, orbit.distance * Math.exp(event.deltaY * 0.001));
      changed();
    }, { passive: false });
  }
}
