// Runs every fuzzer of tests/fuzz without libFuzzer, so with any compiler: first the inputs that
// are kept in tests/fuzz/corpus, which are all that was ever found, then for some seconds mutations
// of those. Without the sanitizers it sees crashes, hangs and broken promises alone.
//
//   fuzz_replay [--seconds S] [--seed N] [--corpus FOLDER] [--failures FOLDER] [NAME | FILE ...]
//
// Names choose fuzzers; all without any. A file is given to the fuzzers that are named. The input
// during which the program ends is written to the folder of failures.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <vector>

// One function a fuzzer, and another where it writes inputs of its own into a folder.
#define UMBEL_FUZZER(name)                                       \
  extern "C" int name##_input(const uint8_t* data, size_t size); \
  extern "C" __attribute__((weak)) int name##_initialize(int* count, char*** arguments);
#include "fuzzers.inc"
#undef UMBEL_FUZZER

namespace {

namespace fs = std::filesystem;
using Input = std::vector<uint8_t>;

struct Fuzzer {
  std::string_view name;
  int (*run)(const uint8_t*, size_t);
  int (*initialize)(int*, char***);
};

constexpr Fuzzer kFuzzers[] = {
#define UMBEL_FUZZER(name) {#name, name##_input, name##_initialize},
#include "fuzzers.inc"
#undef UMBEL_FUZZER
};

struct Options {
  double seconds = 1;
  uint64_t seed = 1;
  fs::path corpus = "tests/fuzz/corpus", failures = fs::temp_directory_path();
  std::vector<std::string> names, files;
};

[[noreturn]] void mistake(const std::string& what) {
  std::fprintf(stderr, "fuzz_replay: %s\n", what.c_str());
  std::exit(2);
}

Options read_options(int count, char** arguments) {
  Options options;
  for (int i = 1; i < count; ++i) {
    const std::string argument = arguments[i];
    const auto value = [&] {
      if (i + 1 == count) mistake(argument + " needs a value");
      return std::string(arguments[++i]);
    };
    const bool is_name = std::any_of(std::begin(kFuzzers), std::end(kFuzzers),
                                     [&](const Fuzzer& f) { return f.name == argument; });
    if (argument == "--seconds")
      options.seconds = std::stod(value());
    else if (argument == "--seed")
      options.seed = std::stoull(value());
    else if (argument == "--corpus")
      options.corpus = value();
    else if (argument == "--failures")
      options.failures = value();
    else if (is_name)
      options.names.push_back(argument);
    else if (fs::is_regular_file(argument))
      options.files.push_back(argument);
    else
      mistake("\"" + argument + "\" is neither a fuzzer nor a file");
  }
  return options;
}

// ---- what is running, for when it ends the program ---------------------------------------------

const Input* running = nullptr;
std::string failure_path;

extern "C" void keep_running_input(int signal) {
  std::signal(signal, SIG_DFL);
  if (running) {
    if (std::FILE* file = std::fopen(failure_path.c_str(), "wb")) {
      std::fwrite(running->data(), 1, running->size(), file);
      std::fclose(file);
      std::fprintf(stderr, "fuzz_replay: the input is %s\n", failure_path.c_str());
    }
  }
  std::raise(signal);
}

void run(const Fuzzer& fuzzer, const Input& input) {
  running = &input;
  // An array of its own, so that the sanitizers see what is read beyond its end.
  const auto own = std::make_unique<uint8_t[]>(input.size());
  std::copy(input.begin(), input.end(), own.get());
  fuzzer.run(own.get(), input.size());
  running = nullptr;
}

// ---- inputs ------------------------------------------------------------------------------------

Input read(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) mistake(path.string() + " cannot be read");
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// Of all files of a folder, in the order of their names.
std::vector<Input> read_all(const fs::path& folder) {
  std::vector<fs::path> paths;
  if (fs::is_directory(folder))
    for (const auto& entry : fs::directory_iterator(folder))
      if (entry.is_regular_file()) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  std::vector<Input> inputs;
  for (const fs::path& path : paths) inputs.push_back(read(path));
  return inputs;
}

/// What the fuzzer itself has to begin with.
std::vector<Input> own_inputs(const Fuzzer& fuzzer) {
  if (!fuzzer.initialize) return {};
  const fs::path folder =
      fs::temp_directory_path() / ("umbel_replay_" + std::to_string(std::random_device{}()));
  fs::create_directories(folder);
  std::string program = "fuzz_replay", argument = folder.string();
  char* all[] = {program.data(), argument.data(), nullptr};
  char** arguments = all;
  int count = 2;
  fuzzer.initialize(&count, &arguments);
  std::vector<Input> inputs = read_all(folder);
  fs::remove_all(folder);
  return inputs;
}

class Mutator {
 public:
  explicit Mutator(uint64_t seed) : random_(seed) {}

  Input make(const std::vector<Input>& inputs) {
    Input input;
    if (!inputs.empty() && below(4)) input = inputs[below(inputs.size())];
    if (input.empty()) {
      input.resize(1 + below(below(8) ? 400 : 6000));
      for (uint8_t& byte : input) byte = static_cast<uint8_t>(random_());
    }
    for (size_t i = 1 + below(8); i-- > 0 && !input.empty();) change(input, inputs);
    return input;
  }

 private:
  size_t below(size_t end) { return random_() % end; }

  void change(Input& input, const std::vector<Input>& inputs) {
    const size_t at = below(input.size()),
                 size = 1 + below(std::min<size_t>(input.size() - at, 16));
    const auto from = input.begin() + static_cast<std::ptrdiff_t>(at);
    const auto to = from + static_cast<std::ptrdiff_t>(size);
    switch (below(6)) {
      case 0:
        input[at] ^= static_cast<uint8_t>(1u << below(8));
        break;
      case 1:
        input[at] = static_cast<uint8_t>(random_());
        break;
      case 2: {
        constexpr uint8_t kSpecial[] = {0, 1, 127, 128, 255};
        std::fill(from, to, kSpecial[below(std::size(kSpecial))]);
        break;
      }
      case 3:
        input.erase(from, to);
        break;
      case 4:
        input.insert(from, size, static_cast<uint8_t>(random_()));
        break;
      default: {
        if (inputs.empty()) break;
        const Input& other = inputs[below(inputs.size())];
        const size_t count = std::min(other.size(), input.size() - at);
        std::copy_n(other.begin(), count, from);
      }
    }
  }

  std::mt19937_64 random_;
};

void replay(const Fuzzer& fuzzer, const Options& options) {
  failure_path = (options.failures / (std::string(fuzzer.name) + "-failure")).string();
  for (const std::string& file : options.files) run(fuzzer, read(file));
  if (!options.files.empty()) return;
  std::vector<Input> inputs = read_all(options.corpus / fuzzer.name);
  const size_t kept = inputs.size();
  for (const Input& input : inputs) run(fuzzer, input);
  for (Input& input : own_inputs(fuzzer)) inputs.push_back(std::move(input));
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(options.seconds);
  Mutator mutator(options.seed);
  size_t made = 0;
  for (; Clock::now() < end; ++made) run(fuzzer, mutator.make(inputs));
  std::printf("%s: %zu kept inputs and %zu others, no failure\n", std::string(fuzzer.name).c_str(),
              kept, made);
  std::fflush(stdout);
}

}  // namespace

int main(int count, char** arguments) {
  const Options options = read_options(count, arguments);
  for (const int signal : {SIGABRT, SIGSEGV, SIGFPE, SIGILL, SIGBUS, SIGTERM})
    std::signal(signal, keep_running_input);
  for (const Fuzzer& fuzzer : kFuzzers)
    if (options.names.empty() ||
        std::count(options.names.begin(), options.names.end(), fuzzer.name))
      replay(fuzzer, options);
  return 0;
}
