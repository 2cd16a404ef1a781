#include "options.hpp"

#include <cmath>
#include <stdexcept>
#include <vector>

namespace sample {

const char* const kUsage =
    "umbel_vulkan [FILE.umbel] [options]: flies round a field of instances of an asset.\n"
    "  --headless                 no window: pictures into --out; so too where there is no "
    "display\n"
    "  --frames N                 end after so many (headless: 8)\n"
    "  --out DIR                  for pictures (.)\n"
    "  --size W H                 of the picture or the window (960 540)\n"
    "  --instances N              1 to 65536 (1000)\n"
    "  --error PIXELS             allowed (1)\n"
    "  --budget MB                of pages on the device (64)\n"
    "  --looks normals|clusters|shaded\n"
    "  --trace                    by rays, with shadows, instead of drawing\n"
    "  --no-mesh-shaders          vertex pulling, even where there are mesh shaders\n"
    "  --no-occlusion             draws what is hidden, too\n"
    "  --validate                 with the validation layers; faults end it with 1\n";

namespace {

uint32_t number(const std::string& word, uint32_t most) {
  size_t used = 0;
  unsigned long value = 0;
  if (!word.empty() && word[0] >= '0' && word[0] <= '9') {
    try {
      value = std::stoul(word, &used);
    } catch (const std::out_of_range&) {
    }
  }
  if (used != word.size() || value == 0 || value > most) {
    throw std::invalid_argument("not a number from 1 to " + std::to_string(most) + ": " + word);
  }
  return static_cast<uint32_t>(value);
}

float pixels(const std::string& word) {
  size_t used = 0;
  float value = 0;
  try {
    value = std::stof(word, &used);
  } catch (const std::exception&) {
  }
  if (used != word.size() || !(value > 0) || !std::isfinite(value)) {
    throw std::invalid_argument("not a number above 0: " + word);
  }
  return value;
}

FrameInput::Looks looks(const std::string& word) {
  if (word == "normals") return FrameInput::Looks::kNormals;
  if (word == "clusters") return FrameInput::Looks::kClusters;
  if (word == "shaded") return FrameInput::Looks::kShaded;
  throw std::invalid_argument("no such looks: " + word);
}

// The words of a command line, one after the other.
class Words {
 public:
  Words(int argc, char** argv) : words_(argv + 1, argv + argc) {}
  bool next(std::string& word) {
    if (at_ == words_.size()) return false;
    word = words_[at_++];
    return true;
  }
  /// What follows the word that was taken last.
  std::string value() {
    if (at_ == words_.size()) throw std::invalid_argument(words_[at_ - 1] + " needs a value");
    return words_[at_++];
  }

 private:
  std::vector<std::string> words_;
  size_t at_ = 0;
};

constexpr uint32_t kMostPixels = 16384, kMostFrames = 1u << 20, kMostMegabytes = 1u << 16;

void take_file(const std::string& word, std::string& file) {
  if (word.starts_with("-") || !file.empty()) {
    throw std::invalid_argument("no such option: " + word);
  }
  file = word;
}

}  // namespace

Options parse_options(int argc, char** argv) {
  Options options;
  Words words(argc, argv);
  std::string word;
  while (words.next(word)) {
    if (word == "--headless") {
      options.headless = true;
    } else if (word == "--help" || word == "-h") {
      options.help = true;
    } else if (word == "--frames") {
      options.frames = number(words.value(), kMostFrames);
    } else if (word == "--out") {
      options.out = words.value();
    } else if (word == "--instances") {
      options.instances = number(words.value(), 1u << 16);
    } else if (word == "--budget") {
      options.budget_mb = number(words.value(), kMostMegabytes);
    } else if (word == "--error") {
      options.input.pixel_error = pixels(words.value());
    } else if (word == "--size") {
      options.renderer.width = number(words.value(), kMostPixels);
      options.renderer.height = number(words.value(), kMostPixels);
    } else if (word == "--looks") {
      options.input.looks = looks(words.value());
    } else if (word == "--trace") {
      options.trace = true;
    } else if (word == "--no-mesh-shaders") {
      options.device.mesh_shaders = false;
    } else if (word == "--no-occlusion") {
      options.input.occlusion = false;
    } else if (word == "--validate") {
      options.device.validation = true;
    } else {
      take_file(word, options.file);
    }
  }
  return options;
}

DeformOptions parse_deform_options(int argc, char** argv) {
  DeformOptions options;
  Words words(argc, argv);
  std::string word;
  while (words.next(word)) {
    if (word == "--frames") {
      options.frames = number(words.value(), kMostFrames);
    } else if (word == "--out") {
      options.out = words.value();
    } else if (word == "--max-triangles") {
      options.max_triangles = number(words.value(), 512);
    } else if (word == "--size") {
      options.width = number(words.value(), kMostPixels);
      options.height = number(words.value(), kMostPixels);
    } else if (word == "--validate") {
      options.device.validation = true;
    } else {
      take_file(word, options.file);
    }
  }
  return options;
}

}  // namespace sample
