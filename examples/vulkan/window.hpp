// A window on the screen, by GLFW: its surface, and what the mouse and the keys do to the controls.
// Built where GLFW is.
#pragma once

#include <string>
#include <vector>

#include "controls.hpp"

struct GLFWwindow;

namespace sample {

class Window {
 public:
  /// Throws Unavailable where there is no display.
  Window(uint32_t width, uint32_t height);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  /// Of the instance, for a surface.
  std::vector<const char*> extensions() const;
  VkSurfaceKHR surface(VkInstance instance) const;
  VkExtent2D size() const;
  /// Input goes there, from now on.
  void control(Controls& controls);
  /// Takes what has happened since. False if the window was closed.
  bool poll();
  /// Sleeps until something happens: for a window without a size.
  void wait() const;
  void title(const std::string& text) const;

 private:
  void drag();

  GLFWwindow* window_ = nullptr;
  Controls* controls_ = nullptr;
  double last_x_ = 0, last_y_ = 0;
};

}  // namespace sample
