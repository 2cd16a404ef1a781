#include "window.hpp"

#include <GLFW/glfw3.h>  // after Vulkan's types, which it then knows

#include <algorithm>

#include "unavailable.hpp"

namespace sample {

namespace {

constexpr float kStep = 0.06f;  // of the distance to the target, a press

Controls& controls_of(GLFWwindow* window) {
  return *static_cast<Controls*>(glfwGetWindowUserPointer(window));
}

void press_key(GLFWwindow* window, int key, int, int action, int) {
  if (action == GLFW_RELEASE) return;
  Controls& controls = controls_of(window);
  switch (key) {
    case GLFW_KEY_ESCAPE:
      return glfwSetWindowShouldClose(window, GLFW_TRUE);
    case GLFW_KEY_HOME:
      return controls.home();
    case GLFW_KEY_LEFT:
      return controls.fly(-kStep, 0, 0);
    case GLFW_KEY_RIGHT:
      return controls.fly(kStep, 0, 0);
    case GLFW_KEY_UP:
      return controls.fly(0, kStep, 0);
    case GLFW_KEY_DOWN:
      return controls.fly(0, -kStep, 0);
    case GLFW_KEY_PAGE_UP:
      return controls.fly(0, 0, kStep);
    case GLFW_KEY_PAGE_DOWN:
      return controls.fly(0, 0, -kStep);
    default:
      return;
  }
}

// Characters rather than keys, so that + and [ are where the keyboard has them.
void type(GLFWwindow* window, unsigned int code) {
  if (code >= 'A' && code <= 'Z') code += 'a' - 'A';
  if (code < 128) controls_of(window).press(static_cast<char>(code));
}

void scroll(GLFWwindow* window, double, double notches) {
  controls_of(window).zoom(static_cast<float>(notches));
}

}  // namespace

Window::Window(uint32_t width, uint32_t height) {
  if (glfwInit() == GLFW_FALSE) throw Unavailable("there is no display.");
  glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
  if (glfwVulkanSupported() == GLFW_TRUE) {
    window_ = glfwCreateWindow(static_cast<int>(width), static_cast<int>(height), "Umbel", nullptr,
                               nullptr);
  }
  if (window_ == nullptr) {
    glfwTerminate();
    throw Unavailable("the display takes no window that Vulkan could draw in.");
  }
}

Window::~Window() {
  glfwDestroyWindow(window_);
  glfwTerminate();
}

std::vector<const char*> Window::extensions() const {
  uint32_t count = 0;
  const char** names = glfwGetRequiredInstanceExtensions(&count);
  return {names, names + count};
}

VkSurfaceKHR Window::surface(VkInstance instance) const {
  VkSurfaceKHR surface = VK_NULL_HANDLE;
  check(glfwCreateWindowSurface(instance, window_, nullptr, &surface), "the window's surface");
  return surface;
}

VkExtent2D Window::size() const {
  int width = 0, height = 0;
  glfwGetFramebufferSize(window_, &width, &height);
  return {static_cast<uint32_t>(width), static_cast<uint32_t>(height)};
}

void Window::control(Controls& controls) {
  controls_ = &controls;
  glfwSetWindowUserPointer(window_, &controls);
  glfwSetKeyCallback(window_, press_key);
  glfwSetCharCallback(window_, type);
  glfwSetScrollCallback(window_, scroll);
}

bool Window::poll() {
  glfwPollEvents();
  if (controls_ != nullptr) drag();
  return glfwWindowShouldClose(window_) == GLFW_FALSE;
}

void Window::drag() {
  double x = 0, y = 0;
  int width = 0, height = 0;
  glfwGetCursorPos(window_, &x, &y);
  glfwGetWindowSize(window_, &width, &height);
  const float right = static_cast<float>((x - last_x_) / std::max(height, 1));
  const float down = static_cast<float>((y - last_y_) / std::max(height, 1));
  last_x_ = x;
  last_y_ = y;
  if (right == 0 && down == 0) return;
  if (glfwGetMouseButton(window_, GLFW_MOUSE_BUTTON_LEFT) == GLFW_PRESS) {
    controls_->drag(Drag::kOrbit, right, down);
  } else if (glfwGetMouseButton(window_, GLFW_MOUSE_BUTTON_RIGHT) == GLFW_PRESS) {
    controls_->drag(Drag::kPan, right, down);
  }
}

void Window::wait() const { glfwWaitEvents(); }

void Window::title(const std::string& text) const { glfwSetWindowTitle(window_, text.c_str()); }

}  // namespace sample
