// Throws the plan of joints.csv and gripper.csv with a Franka robot: throw HOST [FOLDER]
//
// It moves slowly to the start pose, asks, sends a row of joints.csv each millisecond, and gives the
// gripper's opening command in its cycle. The object must be in the gripper, held by its grasp command.

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <franka/exception.h>
#include <franka/gripper.h>
#include <franka/lowpass_filter.h>
#include <franka/robot.h>

namespace {

using Joints = std::array<double, 7>;

constexpr double kSlow = 0.2;           // rad/s, fastest joint on the way to the start pose
constexpr double kOpenWidth = 0.08;     // m
constexpr double kOpenSpeed = 0.2;      // m/s
constexpr double kStartNear = 1e-3;     // rad, every joint from the start pose before the throw

struct Opening {
  std::size_t cycle;  // row of joints.csv in whose cycle the command goes out
  double fraction;    // of that cycle which has passed then
};

std::vector<double> numbers(const std::string& line, std::size_t least) {
  std::vector<double> found;
  std::stringstream cells(line);
  std::string cell;
  while (std::getline(cells, cell, ',')) {
    found.push_back(cell == "open" ? 0.0 : std::stod(cell));
  }
  if (found.size() < least) {
    throw std::runtime_error("too few columns: " + line);
  }
  return found;
}

std::ifstream opened(const std::string& path) {
  std::ifstream file(path);
  std::string header;
  if (!std::getline(file, header)) {
    throw std::runtime_error(path + ": cannot be read");
  }
  return file;
}

std::vector<Joints> read_joints(const std::string& path) {
  std::ifstream file = opened(path);
  std::vector<Joints> rows;
  std::string line;
  while (std::getline(file, line)) {
    const std::vector<double> row = numbers(line, 8);  // t, q1 ... q7, dq1 ... dq7
    Joints q;
    std::copy_n(row.begin() + 1, 7, q.begin());
    rows.push_back(q);
  }
  if (rows.size() < 2) {
    throw std::runtime_error(path + ": has no motion");
  }
  return rows;
}

Opening read_opening(const std::string& path) {
  std::ifstream file = opened(path);
  std::string line;
  std::getline(file, line);
  const std::vector<double> row = numbers(line, 4);  // t, command, cycle, fraction
  return {static_cast<std::size_t>(row[2]), row[3]};
}

void ask(const std::string& what) {
  std::cout << what << " Press Enter to go on, Ctrl-C to end. " << std::flush;
  std::string answer;
  if (!std::getline(std::cin, answer)) {
    throw std::runtime_error("nobody answered");
  }
}

// A quintic from rest to rest. Nothing is checked for collisions: look at the way first.
void move_to(franka::Robot& robot, const Joints& goal) {
  Joints from{};
  double time = 0.0, duration = 0.0;
  robot.control([&](const franka::RobotState& state, franka::Duration period) {
    if (duration == 0.0) {
      from = state.q_d;
      double far = 0.0;
      for (std::size_t j = 0; j < from.size(); ++j) {
        far = std::max(far, std::abs(goal[j] - from[j]));
      }
      duration = std::max(1.0, 1.875 * far / kSlow);  // 1.875: a quintic's peak over its mean rate
    }
    time = std::min(time + period.toSec(), duration);
    const double s = time / duration, share = s * s * s * (10.0 + s * (6.0 * s - 15.0));
    Joints q;
    for (std::size_t j = 0; j < q.size(); ++j) {
      q[j] = from[j] + share * (goal[j] - from[j]);
    }
    const franka::JointPositions next(q);
    return time >= duration ? franka::MotionFinished(next) : next;
  });
}

void throw_it(franka::Robot& robot, franka::Gripper& gripper, const std::vector<Joints>& rows,
              const Opening& opening) {
  std::atomic<std::size_t> row{0};
  std::atomic<bool> ended{false};
  // The gripper's call blocks, so it has a thread of its own.
  std::thread releasing([&] {
    while (row < opening.cycle && !ended) {
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
    if (row < opening.cycle) {
      return;  // The arm stopped before: keep the object.
    }
    std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(opening.fraction));
    try {
      gripper.move(kOpenWidth, kOpenSpeed);
    } catch (const franka::Exception& error) {
      std::cerr << "gripper: " << error.what() << std::endl;
    }
  });
  try {
    // No limiter and no filter: the motion is within the limits, and they would change it.
    robot.control(
        [&](const franka::RobotState&, franka::Duration period) {
          row = std::min(row + static_cast<std::size_t>(period.toMSec()), rows.size() - 1);
          const franka::JointPositions next(rows[row]);
          return row + 1 == rows.size() ? franka::MotionFinished(next) : next;
        },
        franka::ControllerMode::kJointImpedance, false, franka::kMaxCutoffFrequency);
  } catch (...) {
    ended = true;
    releasing.join();
    throw;
  }
  ended = true;
  releasing.join();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) {
    std::cerr << "usage: " << argv[0] << " HOST [FOLDER]" << std::endl;
    return 2;
  }
  const std::string folder = argc == 3 ? argv[2] : ".";
  try {
    const std::vector<Joints> rows = read_joints(folder + "/joints.csv");
    const Opening opening = read_opening(folder + "/gripper.csv");
    franka::Robot robot(argv[1]);
    franka::Gripper gripper(argv[1]);
    if (!gripper.readOnce().is_grasped) {
      throw std::runtime_error("the gripper holds nothing: let it grasp the object first");
    }
    ask("The arm moves slowly to the start pose. Is the way clear?");
    move_to(robot, rows.front());
    const Joints q = robot.readOnce().q_d;
    for (std::size_t j = 0; j < q.size(); ++j) {
      if (std::abs(q[j] - rows.front()[j]) > kStartNear) {
        throw std::runtime_error("joint " + std::to_string(j + 1) + " is not on the start pose");
      }
    }
    ask("The arm throws. Is everybody out of the way?");
    throw_it(robot, gripper, rows, opening);
  } catch (const std::exception& error) {
    std::cerr << error.what() << std::endl;
    return 1;
  }
  return 0;
}
