#include "show_window.hpp"

#include <cstdio>
#include <memory>
#include <stdexcept>

#include "clock.hpp"
#include "make_frames.hpp"
#include "swapchain.hpp"
#include "unavailable.hpp"
#ifdef SAMPLE_HAS_WINDOW
#include "window.hpp"
#endif

namespace sample {

#ifdef SAMPLE_HAS_WINDOW

namespace {

constexpr double kTitleSeconds = 0.25;

// What is drawn into the window, as the controls say.
class Show {
 public:
  Show(const Options& options, const Field& field, Window& window)
      : options_(options),
        field_(field),
        window_(window),
        device_(with_window(options.device, window)),
        swapchain_(device_, window.surface(device_.instance())),
        controls_(options.input, size_of(field.box), options.budget_mb) {
    window.control(controls_);
    sized_ = swapchain_.resize(window_.size());
    config_ = options.renderer;
    make_renderer();
    std::printf("%s, clusters %s\n%s\n", device_.name().c_str(), renderer_->method().c_str(),
                kControlsHelp);
  }

  void frame() {
    if (!sized_) {
      sized_ = swapchain_.resize(window_.size());
      if (!sized_) return window_.wait();
      config_.width = swapchain_.size().width;
      config_.height = swapchain_.size().height;
      renderer_->resize(config_.width, config_.height);
    }
    if (uint64_t{controls_.budget_mb()} << 20 != config_.budget_bytes) make_renderer();
    const FrameReport report = renderer_->draw(controls_.input(), clock_.seconds());
    sized_ = swapchain_.show(renderer_->color());
    ++frames_;
    if (clock_.seconds() - titled_at_ > kTitleSeconds) write_title(report);
  }

  uint32_t validation_messages() const { return device_.validation_messages(); }

 private:
  static DeviceOptions with_window(DeviceOptions options, const Window& window) {
    options.window_extensions = window.extensions();
    return options;
  }

  // Pages of another budget are loaded anew.
  void make_renderer() {
    config_.budget_bytes = uint64_t{controls_.budget_mb()} << 20;
    if (sized_) {
      config_.width = swapchain_.size().width;
      config_.height = swapchain_.size().height;
    }
    renderer_.reset();
    renderer_ = make_frames(device_, field_, options_, config_);
  }

  void write_title(const FrameReport& report) {
    const double seconds = clock_.seconds() - titled_at_;
    char text[128];
    std::snprintf(text, sizeof text, "%.1f frames/s, %u clusters, ", frames_ / seconds,
                  report.clusters);
    window_.title("Umbel: " + (text + controls_.state()));
    titled_at_ = clock_.seconds();
    frames_ = 0;
  }

  const Options& options_;
  const Field& field_;
  Window& window_;
  Device device_;
  Swapchain swapchain_;
  Controls controls_;
  RendererConfig config_;
  std::unique_ptr<FrameMaker> renderer_;
  Clock clock_;
  bool sized_ = false;  // the swapchain is the window's size
  double titled_at_ = 0;
  uint32_t frames_ = 0;  // since then
};

}  // namespace

bool show_window(const Options& options, const Field& field) {
  std::unique_ptr<Window> window;
  try {
    window = std::make_unique<Window>(options.renderer.width, options.renderer.height);
  } catch (const Unavailable& error) {
    std::printf("no window: %s Pictures into %s.\n", error.what(), options.out.c_str());
    return false;
  }
  Show show(options, field, *window);
  for (uint32_t f = 0; (options.frames == 0 || f < options.frames) && window->poll(); ++f) {
    show.frame();
  }
  if (show.validation_messages() > 0) throw std::runtime_error("validation found faults.");
  return true;
}

#else

bool show_window(const Options& options, const Field&) {
  std::printf("no window: built without GLFW. Pictures into %s.\n", options.out.c_str());
  return false;
}

#endif

}  // namespace sample
