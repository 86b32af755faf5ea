// SPDX-License-Identifier: BSD-3-Clause
// node read.js <file.mcap>: reads it twice with @mcap/core, from front to back and by its index,
// with every checksum; holds each message against its schema, and Foxglove's schemas against those
// of @foxglove/schemas. Prints what it found as JSON.
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const foxglove = require("@foxglove/schemas/jsonschema");
const assert = require("assert");
const fs = require("fs");

const CRC = Array.from({ length: 256 }, (_, i) => {
  for (let k = 0; k < 8; ++k) i = i & 1 ? 0xedb88320 ^ (i >>> 1) : i >>> 1;
  return i >>> 0;
});
const crc32 = (bytes) => {
  let c = 0xffffffff;
  for (const b of bytes) c = CRC[(c ^ b) & 255] ^ (c >>> 8);
  return ~c >>> 0;
};

// What of JSON schema the two have in use.
function check(value, schema, path) {
  if (schema.oneOf) return assert(schema.oneOf.some((s) => s.const === value), `${path}: ${value}`);
  if (schema.type === "integer") assert(Number.isInteger(value), path);
  if (schema.type === "number") assert(Number.isFinite(value), path);
  if (schema.type === "string") assert.strictEqual(typeof value, "string", path);
  if (schema.minimum !== undefined) assert(value >= schema.minimum, path);
  if (schema.maximum !== undefined) assert(value <= schema.maximum, path);
  if (schema.type === "array") value.forEach((v, i) => check(v, schema.items, `${path}[${i}]`));
  if (schema.type !== "object") return;
  assert(value !== null && typeof value === "object" && !Array.isArray(value), path);
  for (const key of schema.required ?? []) assert(key in value, `${path}: no ${key}`);
  for (const [key, v] of Object.entries(value)) {
    assert(key in schema.properties, `${path}: ${key} is not in the schema`);
    check(v, schema.properties[key], `${path}.${key}`);
  }
}
const bare = (schema) =>
  JSON.parse(JSON.stringify(schema, (k, v) => (k === "description" || k === "$comment" ? undefined : v)));

async function main() {
  const bytes = fs.readFileSync(process.argv[2]);
  const stream = new McapStreamReader({ validateCrcs: true });
  stream.append(bytes);
  const kinds = {};
  let dataCrc, footer;
  for (let r; (r = stream.nextRecord()); ) {
    kinds[r.type] = (kinds[r.type] ?? 0) + 1;
    if (r.type === "DataEnd") dataCrc = r.dataSectionCrc;
    if (r.type === "Footer") footer = r;
  }
  assert(stream.done(), "the file ends early");
  // A record of 9 + 4 bytes ends the data, one of 9 + 20 and 8 bytes more the file.
  const start = Number(footer.summaryStart);
  assert.strictEqual(crc32(bytes.subarray(0, start - 13)), dataCrc, "checksum of the data");
  assert.strictEqual(crc32(bytes.subarray(start, bytes.length - 12)), footer.summaryCrc, "of the summary");

  const reader = await McapIndexedReader.Initialize({
    readable: {
      size: async () => BigInt(bytes.length),
      read: async (offset, size) => bytes.subarray(Number(offset), Number(offset + size)),
    },
  });
  const schemas = {};
  for (const [id, s] of reader.schemasById) {
    schemas[id] = JSON.parse(new TextDecoder().decode(s.data));
    assert.strictEqual(s.encoding, "jsonschema");
    if (s.name.startsWith("foxglove.")) {
      assert.deepStrictEqual(bare(schemas[id]), bare(foxglove[s.name.slice(9)]), s.name);
    }
  }
  const topics = {}, first = {}, last = {};
  let previous = 0n;
  for await (const m of reader.readMessages()) {
    const channel = reader.channelsById.get(m.channelId);
    const value = JSON.parse(new TextDecoder().decode(m.data));
    check(value, schemas[channel.schemaId], channel.topic);
    assert(m.logTime >= previous, "messages by the index are in order");
    previous = m.logTime;
    topics[channel.topic] = (topics[channel.topic] ?? 0) + 1;
    first[channel.topic] ??= { time: Number(m.logTime), value };
    last[channel.topic] = { time: Number(m.logTime), value };
  }
  const s = reader.statistics;
  for (const [id, count] of s.channelMessageCounts) {
    assert.strictEqual(Number(count), topics[reader.channelsById.get(id).topic] ?? 0, "statistics");
  }
  assert.strictEqual(Number(s.messageCount), kinds.Message ?? Number(s.messageCount));
  console.log(JSON.stringify({ kinds, topics, first, last, chunks: s.chunkCount }));
}
main().catch((error) => {
  console.log(`WRONG: ${error.message}`);
  process.exit(1);
});
