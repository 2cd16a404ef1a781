// Puts a cluster on the list that a pass draws.
void show(uint cluster, uint instance, uint into) {
  uint slot = atomicAdd(frame.counts.draw[into].y, 1);
  if (slot >= frame.capacity) {
    frame.counts.overflow = 1;
    return;
  }
  frame.visible.at[into * frame.capacity + slot] = Item(instance, cluster);
  atomicMax(frame.counts.mesh_draw[into].y, slot / kRow + 1);
}
