// Stands in for libfranka in a test: the signatures that throw.cpp uses, as libfranka 0.9 and later
// declare them; what is sent goes to the file sent.csv.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <fstream>
#include <functional>
#include <string>
#include <thread>

#include "exception.h"

namespace franka {

class Duration {
 public:
  explicit Duration(uint64_t milliseconds) : milliseconds_(milliseconds) {}
  double toSec() const { return 1e-3 * static_cast<double>(milliseconds_); }
  uint64_t toMSec() const { return milliseconds_; }

 private:
  uint64_t milliseconds_;
};

struct RobotState {
  std::array<double, 7> q_d{};
};

struct JointPositions {
  explicit JointPositions(const std::array<double, 7>& joints) : q(joints) {}
  std::array<double, 7> q;
  bool motion_finished = false;
};

inline JointPositions MotionFinished(JointPositions command) {
  command.motion_finished = true;
  return command;
}

//! Motions until now; commands sent in the last one; ms of the clock of robot and gripper; whether it moves.
inline std::atomic<uint64_t> motions{0}, sent{0}, ticks{0};
inline std::atomic<bool> moves{false};

enum class ControllerMode { kJointImpedance, kCartesianImpedance };

constexpr double kDefaultCutoffFrequency = 100.0;

class Robot {
 public:
  explicit Robot(const std::string&) {}
  RobotState readOnce() { return state_; }
  void control(
      std::function<JointPositions(const RobotState&, Duration)> next,
      ControllerMode = ControllerMode::kJointImpedance,
      bool limit_rate = false,
      double cutoff_frequency = kDefaultCutoffFrequency) {
    // The controller takes its time to begin.
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    std::ofstream file("sent.csv", std::ios::app);
    file.precision(12);
    file << "motion," << limit_rate << "," << cutoff_frequency << "\n";
    sent = 0;
    ++motions;
    moves = true;
    // The way to the start pose may take less time than it says.
    const std::chrono::microseconds tick(limit_rate || cutoff_frequency < 1000.0 ? 0 : 1000);
    for (uint64_t first = 0;; first = 1) {
      JointPositions command = next(state_, Duration(first));
      state_.q_d = command.q;
      for (double q : command.q) {
        file << q << ",";
      }
      file << "\n";
      ++sent;
      ++ticks;
      if (command.motion_finished) {
        moves = false;
        return;
      }
      std::this_thread::sleep_for(tick);
    }
  }

 private:
  RobotState state_;
};

}  // namespace franka
