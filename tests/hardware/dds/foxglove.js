// SPDX-License-Identifier: BSD-3-Clause
// Reads a job from each line of the standard input, {type, hex, value}: `hex` must be the message
// `value` by @foxglove/rosmsg2-serialization, in every field and to the last byte, where there is
// a `hex`. Answers a line with the hex that it writes of the same value, and one with the same
// message in big endian.
const { CdrWriter, EncapsulationKind } = require("@foxglove/cdr");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader, MessageWriter } = require("@foxglove/rosmsg2-serialization");
const assert = require("assert");

const parts = {
  "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
  "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
  "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
  "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
  "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
  "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
  "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
  "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
  "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance",
  "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride",
  "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset",
};
const roots = {
  "sensor_msgs/JointState":
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort",
  "nav_msgs/Odometry":
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n" +
    "geometry_msgs/TwistWithCovariance twist",
  "geometry_msgs/Twist": parts["geometry_msgs/Twist"],
  "std_msgs/Float64MultiArray": "std_msgs/MultiArrayLayout layout\nfloat64[] data",
};

// With the parts that it has and no other: of two that are the same the library drops one.
function definitionOf(type) {
  let text = roots[type];
  const used = new Set();
  const add = (fields) => {
    for (const name of Object.keys(parts)) {
      if (!fields.includes(`${name} `) && !fields.includes(`${name}[`)) continue;
      if (used.has(name)) continue;
      used.add(name);
      text += `\n================\nMSG: ${name}\n${parts[name]}`;
      add(parts[name]);
    }
  };
  add(roots[type]);
  return parse(text, { ros2: true });
}

// The library writes little endian only; its writer of numbers and strings knows both.
function writeBigEndian(definition, value) {
  const writer = new CdrWriter({ kind: EncapsulationKind.CDR_BE, size: 65536 });
  const writeFields = (fields, message) => {
    for (const field of fields) {
      const one = (x) => {
        if (field.isComplex) {
          writeFields(definition.find((d) => d.name === field.type).definitions, x);
        } else if (field.type === "time") {
          writer.int32(x.sec).uint32(x.nanosec);
        } else {
          writer[field.type](x);
        }
      };
      const x = message[field.name];
      if (!field.isArray) {
        one(x);
      } else {
        if (field.arrayLength === undefined) writer.sequenceLength(x.length);
        x.forEach(one);
      }
    }
  };
  writeFields(definition.find((d) => d.name === undefined).definitions, value);
  return writer.data;
}

const plain = (x) =>
  ArrayBuffer.isView(x) || Array.isArray(x)
    ? Array.from(x, plain)
    : typeof x === "object"
      ? Object.fromEntries(Object.entries(x).map(([key, y]) => [key, plain(y)]))
      : x;

for (const line of require("fs").readFileSync(0, "utf8").split("\n")) {
  if (!line) continue;
  const { type, hex, value } = JSON.parse(line);
  const definition = definitionOf(type);
  const written = Buffer.from(new MessageWriter(definition).writeMessage(value)).toString("hex");
  if (hex !== undefined) {
    const read = new MessageReader(definition).readMessage(Buffer.from(hex, "hex"));
    assert.deepStrictEqual(plain(read), value, type);
    assert.strictEqual(written, hex, type);
  }
  console.log(written);
  console.log(Buffer.from(writeBigEndian(definition, value)).toString("hex"));
}
