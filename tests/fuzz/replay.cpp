// The main of a fuzz target that is built without libFuzzer. Without options it runs every file of the
// folders once. With --runs it then runs that many changed inputs: a target's own mutator makes them, or
// bytes are changed at random. The same seed gives the same inputs. Nothing measures coverage, so that an
// optimised build reaches a million runs in the time that libFuzzer and the sanitizers need for ten thousand.
//
//     fuzz_NAME FOLDER...
//     fuzz_NAME --runs COUNT [--seconds LIMIT] [--seed SEED] [--input FILE] FOLDER...
//
// FILE always holds the input that runs: after a crash, the one that caused it.
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
extern "C" __attribute__((weak)) std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                                                     std::size_t most, unsigned seed);

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kLargest = 6000;     // as in tests/fuzz/run
constexpr std::size_t kMostInputs = 1000;  // that changes begin with

struct Request {
  std::vector<std::filesystem::path> folders;
  long runs = 0;
  double seconds = 1e9;
  unsigned seed = 1;
  const char* input = nullptr;
};

// A file in shared memory: its content survives the process, whatever ends it.
class CurrentInput {
 public:
  explicit CurrentInput(const char* name) {
    if (name == nullptr) return;
    file_ = ::open(name, O_RDWR | O_CREAT | O_TRUNC, 0600);
    if (file_ < 0 || ::ftruncate(file_, kLargest) != 0) std::abort();
    bytes_ = ::mmap(nullptr, kLargest, PROT_WRITE, MAP_SHARED, file_, 0);
    if (bytes_ == MAP_FAILED) std::abort();
  }
  ~CurrentInput() {
    if (bytes_ != nullptr) ::munmap(bytes_, kLargest);
    if (file_ >= 0) ::close(file_);
  }
  CurrentInput(const CurrentInput&) = delete;
  CurrentInput& operator=(const CurrentInput&) = delete;

  void hold(const Bytes& input) const {
    if (bytes_ == nullptr) return;
    // Memory beyond the end of the file cannot be written.
    if (::ftruncate(file_, static_cast<off_t>(input.size())) != 0) std::abort();
    if (!input.empty()) std::memcpy(bytes_, input.data(), input.size());  // an empty one has no address
  }

 private:
  int file_ = -1;
  void* bytes_ = nullptr;
};

// Of a copy of its own size, so that a sanitizer sees what is read beyond it.
void run(const Bytes& input) { LLVMFuzzerTestOneInput(input.data(), input.size()); }

void change_bytes(Bytes& input, std::mt19937& random) {
  const auto at = [&](std::size_t size) { return static_cast<std::ptrdiff_t>(random() % size); };
  for (auto times = 1 + random() % 4; times > 0; --times) {
    const auto byte = static_cast<std::uint8_t>(random());
    const auto kind = input.empty() ? 0U : random() % 5;
    if (kind == 0) {
      input.insert(input.begin() + at(input.size() + 1), byte);
    } else if (kind == 1) {
      input[static_cast<std::size_t>(at(input.size()))] = byte;
    } else if (kind == 2) {
      input[static_cast<std::size_t>(at(input.size()))] ^= static_cast<std::uint8_t>(1U << (byte % 8U));
    } else if (kind == 3) {
      const auto first = input.begin() + at(input.size());
      input.erase(first, first + 1 + at(static_cast<std::size_t>(input.end() - first)));
    } else {  // a part of it again, elsewhere
      const auto first = input.begin() + at(input.size());
      const Bytes part(first, first + 1 + at(static_cast<std::size_t>(input.end() - first)));
      input.insert(input.begin() + at(input.size() + 1), part.begin(), part.end());
    }
  }
  input.resize(std::min(input.size(), kLargest));
}

Bytes changed(Bytes input, std::mt19937& random) {
  if (LLVMFuzzerCustomMutator == nullptr) {
    change_bytes(input, random);
    return input;
  }
  const std::size_t size = std::min(input.size(), kLargest);
  input.resize(kLargest);
  input.resize(LLVMFuzzerCustomMutator(input.data(), size, kLargest, static_cast<unsigned>(random())));
  return input;
}

std::vector<Bytes> replay(const std::vector<std::filesystem::path>& folders) {
  std::vector<std::filesystem::path> files;
  for (const auto& folder : folders) {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<Bytes> inputs;
  for (const auto& path : files) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream content;
    content << file.rdbuf();
    std::printf("%s\n", path.c_str());  // the last name is the file that caused a crash
    std::fflush(stdout);
    const std::string text = std::move(content).str();
    inputs.emplace_back(text.begin(), text.end());
    run(inputs.back());
  }
  std::printf("%zu files replayed\n", files.size());
  std::fflush(stdout);
  return inputs;
}

// Changes of changes: each result may be what a later one begins with.
void run_changed(const Request& request, std::vector<Bytes> inputs) {
  const auto begin = std::chrono::steady_clock::now();
  const auto passed = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  const CurrentInput current(request.input);
  std::mt19937 random(request.seed);
  const std::size_t kept = inputs.size();  // these stay
  long runs = 0;
  for (; runs < request.runs && passed() < request.seconds; ++runs) {
    Bytes input = changed(inputs[random() % inputs.size()], random);
    input.shrink_to_fit();
    current.hold(input);
    run(input);
    if (inputs.size() < kept + kMostInputs) {
      inputs.push_back(std::move(input));
    } else {
      inputs[kept + random() % kMostInputs] = std::move(input);
    }
  }
  std::printf("%ld runs in %.0f s\n", runs, passed());
}

Request parse(int argc, char** argv) {
  Request request;
  for (int i = 1; i < argc; ++i) {
    const std::string_view name = argv[i];
    if (!name.starts_with("--")) {
      request.folders.emplace_back(name);
      continue;
    }
    const char* const value = ++i < argc ? argv[i] : "";
    if (name == "--runs") request.runs = std::atol(value);
    if (name == "--seconds") request.seconds = std::atof(value);
    if (name == "--seed") request.seed = static_cast<unsigned>(std::atol(value));
    if (name == "--input") request.input = value;
  }
  return request;
}

}  // namespace

int main(int argc, char** argv) {
  const Request request = parse(argc, argv);
  std::vector<Bytes> inputs = replay(request.folders);
  if (inputs.empty()) return 1;
  if (request.runs > 0) run_changed(request, std::move(inputs));
  return 0;
}
