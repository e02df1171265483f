// A hand whose orders go to the file orders.csv: command, width, tolerance, speed, force, and the number
// of rows that the arm had been sent. An order to move opens it 30 ms later, one to grasp closes it 200 ms
// later, and each blocks until then. The environment says what it is like, see `said`.
#pragma once

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "exception.h"
#include "robot.h"

namespace franka {

struct GripperState {
  double width = 0.02;
  bool is_grasped = true;
};

class Gripper {
 public:
  explicit Gripper(const std::string&) {}

  GripperState readOnce() const {
    std::this_thread::sleep_for(std::chrono::microseconds(200));
    if (motions > 1 && sent > said("FAILS", 1e9)) {
      throw NetworkException("libfranka: the connection ended");
    }
    const std::lock_guard<std::mutex> _(mutex_);
    GripperState state;
    state.is_grasped = said("HOLDS", 1) > 0;
    state.width = state.is_grasped ? 0.02 : 0.01;
    double moves = 0, grasps = 0;
    for (const auto& [grasp, time] : orders_) {
      const double since = static_cast<double>(ticks - time);
      ++(grasp ? grasps : moves);
      if (!grasp && since >= 30 && moves <= said("OPENS", 99)) {
        state = {0.08, false};
      } else if (grasp && since >= 200) {
        const bool holds = grasps <= said("GRASPS", 99) &&
                           (grasps != said("DROPS", 0) || since < said("AFTER", 0));
        state = {holds ? 0.02 : 0.0, holds};
      }
    }
    return state;
  }

  bool grasp(double width, double speed, double force, double inner = 0.005,
             double outer = 0.005) const {
    order("grasp", width, inner == outer ? inner : -1.0, speed, force, 200);
    return readOnce().is_grasped;
  }

  bool move(double width, double speed) const {
    order("move", width, 0.0, speed, 0.0, 30);
    return true;
  }

 private:
  //! A number of the environment: HOLDS: whether the hand holds something at first, else it is nearly
  //! closed. OPENS, GRASPS: how many orders it follows. DROPS: the number of the grasp whose object it
  //! loses, AFTER ms. FAILS: row of the second motion after which its connection is lost.
  static double said(const char* name, double otherwise) {
    const char* value = std::getenv(name);
    return value == nullptr ? otherwise : std::atof(value);
  }

  void order(const char* command, double width, double tolerance, double speed, double force,
             uint64_t lasts) const {
    const uint64_t begin = ticks;
    {
      const std::lock_guard<std::mutex> _(mutex_);
      std::ofstream("orders.csv", std::ios::app) << command << "," << width << "," << tolerance << ","
                                                 << speed << "," << force << "," << sent << "\n";
      orders_.emplace_back(force > 0.0, begin);
    }
    while (ticks < begin + lasts) {
      std::this_thread::sleep_for(std::chrono::microseconds(100));
      if (!moves) {
        ++ticks;
      }
    }
  }

  mutable std::mutex mutex_;
  mutable std::vector<std::pair<bool, uint64_t>> orders_;
};

}  // namespace franka
