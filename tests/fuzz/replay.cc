// Gives a target its corpus, and then a fixed number of mutations of it: what scripts/test runs.
//
// TARGET COUNT SEED FILE_OR_FOLDER …
// Keeps an input that breaks a promise in the file found_input.
#include <charconv>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <set>

#include <fcntl.h>

#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/mutate.h"

namespace hlm::fuzz {
namespace {

constexpr const char* kFound = "found_input";

const Bytes* at_hand = nullptr;

/// Keeps the input that ends the program, so that it can be given again.
void keep_input(int) {
  const int file = open(kFound, O_WRONLY | O_CREAT | O_TRUNC, 0644);
  const bool kept =
      at_hand != nullptr && file >= 0 &&
      write(file, at_hand->data(), at_hand->size()) == static_cast<ssize_t>(at_hand->size());
  const char* const text = kept ? "the input is kept in found_input\n" : "no input was kept\n";
  static_cast<void>(!write(STDERR_FILENO, text, std::strlen(text)));
}

Bytes read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// All files, in the order of their names.
std::vector<Bytes> read_corpus(const std::vector<std::string>& places) {
  std::set<std::filesystem::path> files;
  for (const std::filesystem::path place : places) {
    if (std::filesystem::is_regular_file(place)) {
      files.insert(place);
      continue;
    }
    for (const auto& entry : std::filesystem::directory_iterator(place)) {
      if (entry.is_regular_file()) files.insert(entry.path());
    }
  }
  std::vector<Bytes> corpus;
  for (const auto& file : files) corpus.push_back(read_file(file));
  return corpus;
}

std::uint64_t whole_number(const char* text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text, text + std::strlen(text), number);
  if (error != std::errc{} || *end != '\0') {
    std::cerr << '\'' << text << "' must be a whole number\n";
    std::exit(2);
  }
  return number;
}

void give(const Bytes& input) {
  at_hand = &input;
  LLVMFuzzerTestOneInput(input.data(), input.size());
}

void give_mutations(const std::vector<Bytes>& corpus, std::uint64_t count, std::uint64_t seed) {
  Mutator mutator(corpus, seed);
  for (std::uint64_t i = 0; i < count; ++i) give(mutator.next());
}

}  // namespace
}  // namespace hlm::fuzz

// Sanitizers end the program by the signal that keeps the input.
extern "C" const char* __asan_default_options() { return "abort_on_error=1"; }
extern "C" const char* __ubsan_default_options() { return "abort_on_error=1"; }

int main(int argc, char** argv) {
  using namespace hlm::fuzz;
  if (argc < 4) {
    std::cerr << "usage: " << argv[0] << " COUNT SEED FILE_OR_FOLDER …\n";
    return 2;
  }
  std::signal(SIGABRT, keep_input);
  const std::uint64_t count = whole_number(argv[1]);
  const std::uint64_t seed = whole_number(argv[2]);
  const std::vector<Bytes> corpus = read_corpus({argv + 3, argv + argc});
  for (const Bytes& input : corpus) give(input);
  const std::uint64_t of_corpus = accepted;
  std::cout << corpus.size() << " inputs of the corpus, " << of_corpus << " uses\n";
  if (of_corpus == 0) {
    std::cerr << "no input of the corpus is good enough to be used: make it anew\n";
    return 1;
  }
  std::cout << count << " mutations from seed " << seed << std::endl;
  give_mutations(corpus, count, seed);
  std::cout << accepted - of_corpus << " uses\n";
}
