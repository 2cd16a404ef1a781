// Reads and writes the elements of a .umbel file's tables. docs/format.md has every byte.
#pragma once

#include "asset/file/format.hpp"
#include "base/bytes.hpp"

namespace umbel::asset {

inline void write(ByteWriter& out, const Range& range) {
  out.u32(range.offset);
  out.u32(range.count);
}

inline void write(ByteWriter& out, const Sphere& sphere) {
  out.vec3(sphere.center);
  out.f32(sphere.radius);
}

inline void write(ByteWriter& out, const Vec3d& point) {
  out.f64(point.x);
  out.f64(point.y);
  out.f64(point.z);
}

inline void write(ByteWriter& out, const AttributeFormat& attribute) {
  out.u32(attribute.attribute);
  out.u32(attribute.set);
  out.u32(static_cast<uint32_t>(attribute.coding));
  out.u16(attribute.components);
  out.u16(attribute.is_smooth);
  out.u32(attribute.bits);
  out.f32(attribute.step);
}

inline void write(ByteWriter& out, const MeshEntry& entry) {
  out.u64(entry.mesh.source_triangles);
  out.u64(entry.mesh.source_vertices);
  out.u64(entry.mesh.source_digest);
  out.vec3(entry.mesh.bounds.min);
  out.vec3(entry.mesh.bounds.max);
  write(out, entry.attributes);
  write(out, entry.levels);
  write(out, entry.roots);
  write(out, entry.nodes);
  out.u32(entry.mesh.groups);
  out.u32(entry.mesh.clusters);
}

inline void write(ByteWriter& out, const lod::Node& node) {
  write(out, node.sphere);
  out.f32(node.error);
  out.u32(node.group);
  write(out, node.children);
}

inline void write(ByteWriter& out, const Instance& instance) {
  for (const float f : instance.transform.rows) out.f32(f);
  out.u32(instance.mesh);
  out.u32(0);
  out.u64(0);
}

inline void write(ByteWriter& out, const FileEntry& file) {
  out.u64(file.offset);
  out.u64(file.bytes);
  out.u64(file.checksum);
}

inline void write(ByteWriter& out, const PageEntry& page) {
  out.u64(page.offset);
  out.u32(page.bytes);
  out.u32(page.groups);
  out.u64(page.checksum);
}

inline void write(ByteWriter& out, uint64_t checksum) { out.u64(checksum); }
inline void write(ByteWriter& out, float error) { out.f32(error); }

inline void read(ByteReader& in, Range& range) { range = in.range(); }
inline void read(ByteReader& in, uint64_t& checksum) { checksum = in.u64(); }
inline void read(ByteReader& in, float& error) { error = in.f32(); }

inline void read(ByteReader& in, Vec3d& point) {
  point.x = in.f64();
  point.y = in.f64();
  point.z = in.f64();
}

inline Sphere read_sphere(ByteReader& in) {
  const Vec3 center = in.vec3();
  return {center, in.f32()};
}

inline void read(ByteReader& in, AttributeFormat& attribute) {
  attribute.attribute = in.u32();
  attribute.set = in.u32();
  attribute.coding = static_cast<Coding>(in.u32());
  attribute.components = in.u16();
  attribute.is_smooth = in.u16();
  attribute.bits = in.u32();
  attribute.step = in.f32();
}

inline void read(ByteReader& in, MeshEntry& entry) {
  entry.mesh.source_triangles = in.u64();
  entry.mesh.source_vertices = in.u64();
  entry.mesh.source_digest = in.u64();
  entry.mesh.bounds.min = in.vec3();
  entry.mesh.bounds.max = in.vec3();
  entry.attributes = in.range();
  entry.levels = in.range();
  entry.roots = in.range();
  entry.nodes = in.range();
  entry.mesh.groups = in.u32();
  entry.mesh.clusters = in.u32();
}

inline void read(ByteReader& in, lod::Node& node) {
  node.sphere = read_sphere(in);
  node.error = in.f32();
  node.group = in.u32();
  node.children = in.range();
}

inline void read(ByteReader& in, Instance& instance) {
  for (float& f : instance.transform.rows) f = in.f32();
  instance.mesh = in.u32();
}

inline void read(ByteReader& in, FileEntry& file) {
  file.offset = in.u64();
  file.bytes = in.u64();
  file.checksum = in.u64();
}

inline void read(ByteReader& in, PageEntry& page) {
  page.offset = in.u64();
  page.bytes = in.u32();
  page.groups = in.u32();
  page.checksum = in.u64();
}

inline void write(ByteWriter& out, const GroupRef& reference) {
  out.u32(reference.group);
  out.u32(reference.page);
  out.u32(reference.parents);
  out.f32(reference.error);
  write(out, reference.sphere);
}

inline void read(ByteReader& in, GroupRef& reference) {
  reference.group = in.u32();
  reference.page = in.u32();
  reference.parents = in.u32();
  reference.error = in.f32();
  reference.sphere = read_sphere(in);
}

}  // namespace umbel::asset
