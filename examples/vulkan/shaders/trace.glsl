// What a ray finds: the triangle's normal in the world, not of unit length, and its cluster.
struct Hit { vec3 normal; float away; uint cluster; };
