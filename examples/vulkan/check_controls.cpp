#include <cmath>

#include "checks.hpp"
#include "controls.hpp"
#include "projection.hpp"

namespace sample {

namespace {

float length(const umbel::Vec3& a) { return std::sqrt(dot(a, a)); }

bool near(float a, float b) { return std::abs(a - b) < 1e-4f * (1 + std::abs(b)); }

}  // namespace

void check_controls() {
  FrameInput start;
  start.camera.position = {0, 0, 2};
  start.camera.target = {0, 0, 0};
  start.pixel_error = 1;

  Controls controls(start, 1, 64);
  const auto eye = [&] { return controls.input().camera.position; };
  controls.drag(Drag::kOrbit, 0.5f, 0);
  expect(near(eye().x, -2) && near(length(eye()), 2),
         "a drag to the right by half the height turns the scene by a quarter");
  controls.drag(Drag::kOrbit, 0, 5);
  expect(near(length(eye()), 2) && std::abs(eye().y) < 2, "a drag down does not pass the pole");
  controls.home();
  controls.drag(Drag::kPan, 0.25f, 0);
  const umbel::Vec3 moved = controls.input().camera.target;
  expect(near(moved.x, -std::tan(start.camera.fov_y / 2)) && near(moved.z, 0),
         "what lies at the target follows the mouse");
  controls.home();
  for (int i = 0; i < 200; ++i) controls.zoom(1);
  expect(length(eye()) > 5e-4f && length(eye()) < 2e-3f, "the wheel stops before the target");
  controls.home();
  controls.press('w');
  expect(eye().z < 2 && near(length(minus(eye(), controls.input().camera.target)), 2),
         "W flies forward");
  controls.press('+');
  controls.press('+');
  controls.press(']');
  controls.press('f');
  controls.press('2');
  expect(near(controls.input().pixel_error, 0.5f) && controls.input().frozen &&
             controls.budget_mb() == 128 && controls.input().looks == FrameInput::Looks::kClusters,
         "keys change error, budget and looks, and freeze");
  expect(!controls.press('z'), "a key without a meaning does nothing");
}

}  // namespace sample
