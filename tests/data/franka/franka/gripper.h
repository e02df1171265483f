#pragma once

#include <fstream>
#include <string>

#include "robot.h"

namespace franka {

struct GripperState {
  bool is_grasped = true;
};

class Gripper {
 public:
  explicit Gripper(const std::string&) {}
  GripperState readOnce() const { return {}; }
  bool move(double width, double speed) const {
    std::ofstream("opened.csv") << width << "," << speed << "," << sent << "\n";
    return true;
  }
};

}  // namespace franka
