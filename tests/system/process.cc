#include "tests/system/process.h"

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

namespace hlm::test {
namespace {

std::string temporary_file() {
  char path[] = "/tmp/haptic_test_XXXXXX";
  const int file = mkstemp(path);
  if (file < 0) throw std::runtime_error("no temporary file");
  close(file);
  return path;
}

}  // namespace

bool wait_until(double timeout, const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

Process::Process(const std::vector<std::string>& arguments)
    : output_file_(temporary_file()), error_file_(temporary_file()) {
  std::vector<char*> pointers;
  for (const std::string& argument : arguments)
    pointers.push_back(const_cast<char*>(argument.c_str()));
  pointers.push_back(nullptr);
  pid_ = fork();
  if (pid_ == 0) {
    dup2(open(output_file_.c_str(), O_WRONLY | O_TRUNC), STDOUT_FILENO);
    dup2(open(error_file_.c_str(), O_WRONLY | O_TRUNC), STDERR_FILENO);
    execvp(pointers[0], pointers.data());
    _exit(127);
  }
}

Process::~Process() {
  if (running()) {
    send_signal(SIGTERM);
    if (wait(3) == -1) {
      send_signal(SIGKILL);
      wait(3);
    }
  }
  std::filesystem::remove(output_file_);
  std::filesystem::remove(error_file_);
}

void Process::send_signal(int signal) const { kill(pid_, signal); }

bool Process::running() {
  if (pid_ <= 0) return false;
  int status = 0;
  if (waitpid(pid_, &status, WNOHANG) != pid_) return true;
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  pid_ = -1;
  return false;
}

int Process::wait(double timeout) {
  return wait_until(timeout, [this] { return !running(); }) ? exit_code_ : -1;
}

bool Process::wait_for_error(const std::string& text, double timeout) const {
  return wait_until(timeout, [&] { return error().find(text) != std::string::npos; });
}

std::string Process::read(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

Finished run(const std::vector<std::string>& arguments, double timeout) {
  Process process(arguments);
  const int exit_code = process.wait(timeout);
  return {exit_code, process.output(), process.error()};
}

TemporaryDirectory::TemporaryDirectory() {
  char path[] = "/tmp/haptic_test_XXXXXX";
  if (mkdtemp(path) == nullptr) throw std::runtime_error("no temporary directory");
  path_ = path;
}

TemporaryDirectory::~TemporaryDirectory() { std::filesystem::remove_all(path_); }

int free_port() {
  const int descriptor = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  bind(descriptor, reinterpret_cast<sockaddr*>(&address), size);
  getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size);
  close(descriptor);
  return ntohs(address.sin_port);
}

}  // namespace hlm::test
