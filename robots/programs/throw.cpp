// Sends the motion in FOLDER to a Franka robot: throw HOST [FOLDER]
//
// It moves slowly to the start pose, asks, sends a row of joints.csv each millisecond, and gives the
// gripper each command of gripper.csv in its cycle. If the first one opens the gripper, the object must be
// in it, held by its grasp command. The gripper is watched: if it has not grasped an object, loses one or
// does not open, or if its connection fails, it gets no further command, and the arm brakes along the next
// stop of stops.csv.

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <franka/exception.h>
#include <franka/gripper.h>
#include <franka/lowpass_filter.h>
#include <franka/robot.h>

namespace {

using Joints = std::array<double, 7>;

constexpr double kSlow = 0.2;           // rad/s, fastest joint on the way to the start pose
constexpr double kOpenWidth = 0.08;     // m
constexpr double kGripperSpeed = 0.2;   // m/s
constexpr double kMoved = 2e-3;         // m, change of the gripper's width above its noise
constexpr double kStartNear = 1e-3;     // rad, every joint from the start pose before the throw

// A command to the gripper: a row of gripper.csv.
struct Command {
  std::size_t cycle;        // row of joints.csv in whose cycle it goes out
  double fraction;          // of that cycle which has passed then
  std::size_t check;        // row at which it must be done
  double width, tolerance;  // m
  double force;             // N of a grasp, 0 of an opening
  std::string object;       // its name
};

// The motions to rest that may take the place of joints.csv, by the row at which they begin.
using Stops = std::map<std::size_t, std::vector<Joints>>;

// The first eight cells of a line, and the rest of it as one more.
std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> found;
  std::stringstream stream(line);
  std::string cell;
  while (std::getline(stream, cell, found.size() < 8 ? ',' : '\n')) {
    found.push_back(cell);
  }
  if (found.size() < 8) {
    throw std::runtime_error("too few columns: " + line);
  }
  return found;
}

// The lines of a file after its header.
std::vector<std::string> lines(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::string> found;
  std::string line;
  while (std::getline(file, line)) {
    found.push_back(line);
  }
  if (found.size() < 2) {
    throw std::runtime_error(path + ": cannot be read");
  }
  found.erase(found.begin());
  return found;
}

// The first number of each line, and the joints after it.
std::vector<std::pair<double, Joints>> read_rows(const std::string& path) {
  std::vector<std::pair<double, Joints>> rows;
  for (const std::string& line : lines(path)) {
    const std::vector<std::string> row = cells(line);
    Joints q;
    std::transform(row.begin() + 1, row.begin() + 8, q.begin(),
                   [](const std::string& cell) { return std::stod(cell); });
    rows.emplace_back(std::stod(row[0]), q);
  }
  return rows;
}

std::vector<Joints> read_joints(const std::string& path) {
  std::vector<Joints> found;
  for (const auto& [time, q] : read_rows(path)) {
    found.push_back(q);
  }
  return found;
}

Stops read_stops(const std::string& path) {
  Stops found;
  for (const auto& [cycle, q] : read_rows(path)) {
    found[static_cast<std::size_t>(cycle)].push_back(q);
  }
  return found;
}

std::vector<Command> read_commands(const std::string& path) {
  std::vector<Command> found;
  for (const std::string& line : lines(path)) {
    // t, command, cycle, fraction, check, width, tolerance, force, object.
    const std::vector<std::string> row = cells(line);
    found.push_back({std::stoul(row[2]), std::stod(row[3]), std::stoul(row[4]), std::stod(row[5]),
                     std::stod(row[6]), std::stod(row[7]), row.size() > 8 ? row[8] : ""});
  }
  return found;
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

// What the gripper reported last.
struct Report {
  float width;  // m
  bool holds;   // something
};

Report report_of(const franka::Gripper& gripper) {
  const franka::GripperState state = gripper.readOnce();
  return {static_cast<float>(state.width), state.is_grasped};
}

enum class Fault { kNone, kConnection, kNotGrasped, kLost, kNotOpened };

// Compares the gripper's reports with its commands.
class Watch {
 public:
  Watch(const std::vector<Command>& commands, const Report& before)
      : commands_(commands), kept_(before) {}

  // What is wrong in the cycle of a row of joints.csv. Called in turn; neither waits nor allocates.
  Fault look(std::size_t row, const Report& now) {
    const bool next = given_ < commands_.size() && row >= commands_[given_].cycle;
    const Command* last = given_ > 0 ? &commands_[given_ - 1] : nullptr;
    if (last != nullptr && !checked_ && row >= last->check) {
      checked_ = true;
      if (last->force == 0.0) {
        return is_open(now) ? Fault::kNone : Fault::kNotOpened;
      }
      kept_ = now;
      const bool fits = std::abs(now.width - last->width) < last->tolerance;
      return now.holds && fits ? Fault::kNone : Fault::kNotGrasped;
    }
    const bool keeps = last == nullptr || (checked_ && last->force > 0.0);
    const bool same = now.holds >= kept_.holds && std::abs(now.width - kept_.width) < kMoved;
    if (keeps && !same && !next) {
      return Fault::kLost;
    }
    if (next) {
      ++given_;
      checked_ = false;
    }
    return Fault::kNone;
  }

  // Whether the gripper is wider than around the last object.
  bool is_open(const Report& now) const { return now.width >= kept_.width + kMoved; }

  std::string words(Fault fault, const Report& now) const {
    if (fault == Fault::kConnection) {
      return "the gripper's connection failed; the arm has stopped";
    }
    std::ostringstream found;
    found << commands_[given_ > 0 ? given_ - 1 : 0].object
          << (fault == Fault::kNotGrasped ? " was not grasped: the gripper is "
              : fault == Fault::kLost     ? " was lost: the gripper is "
                                          : " was not thrown: the gripper did not open, is ")
          << std::round(1e3 * now.width) << " mm wide and holds "
          << (now.holds ? "something" : "nothing") << "; the arm has stopped";
    return found.str();
  }

 private:
  const std::vector<Command>& commands_;
  std::size_t given_ = 0;  // commands until now
  bool checked_ = false;   // the last of them
  Report kept_;            // around the last object
};

void give(const franka::Gripper& gripper, const Command& command, std::atomic<bool>& failed) {
  try {
    if (command.force > 0.0) {
      gripper.grasp(command.width, kGripperSpeed, command.force, command.tolerance,
                    command.tolerance);
    } else {
      gripper.move(command.width, kGripperSpeed);
    }
  } catch (const franka::CommandException&) {
    // Not done, or aborted by the next command: the width tells.
  } catch (const franka::Exception&) {
    failed = true;
  }
}

void throw_it(franka::Robot& robot, franka::Gripper& gripper, const std::vector<Joints>& rows,
              const std::vector<Command>& commands, const Stops& stops) {
  std::atomic<std::ptrdiff_t> row{-1};  // -1: the arm has not begun to move.
  std::atomic<bool> ended{false}, failed{false};
  std::atomic<Report> last{report_of(gripper)};
  Watch watch(commands, last);
  // A call of the gripper blocks until it has moved, so each has a thread of its own.
  std::thread commanding([&] {
    std::vector<std::thread> calls;
    for (const Command& command : commands) {
      const auto due = static_cast<std::ptrdiff_t>(command.cycle);
      while (row < due && !ended) {
        std::this_thread::sleep_for(std::chrono::microseconds(50));
      }
      if (row < due) {
        break;  // The arm stops before: keep the object.
      }
      std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(command.fraction));
      calls.emplace_back([&] { give(gripper, command, failed); });
    }
    for (std::thread& call : calls) {
      call.join();
    }
  });
  std::thread watching([&] {
    try {
      while (!ended) {
        last = report_of(gripper);
      }
    } catch (const franka::Exception&) {
      failed = true;
    }
  });
  Fault fault = Fault::kNone;
  Report seen = last;
  std::size_t sample = 0;
  Stops::const_iterator stop = stops.end();
  const auto end = [&] {
    ended = true;
    commanding.join();
    watching.join();
  };
  try {
    // No limiter and no filter: the motion is within the limits, and they would change it.
    robot.control(
        [&](const franka::RobotState&, franka::Duration period) {
          sample += static_cast<std::size_t>(period.toMSec());
          if (fault == Fault::kNone) {
            seen = last;
            const std::size_t next = std::min(sample, rows.size() - 1);
            fault = failed ? Fault::kConnection : watch.look(next, seen);
            if (fault == Fault::kNone) {
              row = static_cast<std::ptrdiff_t>(next);
            } else {
              ended = true;
              stop = stops.lower_bound(sample);
            }
          }
          const bool brakes = stop != stops.end() && sample >= stop->first;
          const std::vector<Joints>& path = brakes ? stop->second : rows;
          const std::size_t at = std::min(sample - (brakes ? stop->first : 0), path.size() - 1);
          const franka::JointPositions next(path[at]);
          return at + 1 == path.size() ? franka::MotionFinished(next) : next;
        },
        franka::ControllerMode::kJointImpedance, false, franka::kMaxCutoffFrequency);
  } catch (...) {
    end();
    throw;
  }
  end();
  if (fault == Fault::kNone) {
    seen = report_of(gripper);
    fault = failed ? Fault::kConnection : watch.is_open(seen) ? Fault::kNone : Fault::kNotOpened;
  }
  if (fault != Fault::kNone) {
    throw std::runtime_error(watch.words(fault, seen));
  }
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
    const std::vector<Command> commands = read_commands(folder + "/gripper.csv");
    const bool picks = commands.front().force > 0.0;
    const Stops stops = read_stops(folder + "/stops.csv");
    franka::Robot robot(argv[1]);
    franka::Gripper gripper(argv[1]);
    if (gripper.readOnce().is_grasped == picks) {
      throw std::runtime_error(picks ? "the gripper holds an object: take it out first"
                                     : "the gripper holds nothing: let it grasp the object first");
    }
    ask(std::string(picks ? "The gripper opens, and the arm" : "The arm") +
        " moves slowly to the start pose. Is the way clear?");
    if (picks) {
      gripper.move(kOpenWidth, kGripperSpeed);
    }
    move_to(robot, rows.front());
    const Joints q = robot.readOnce().q_d;
    for (std::size_t j = 0; j < q.size(); ++j) {
      if (std::abs(q[j] - rows.front()[j]) > kStartNear) {
        throw std::runtime_error("joint " + std::to_string(j + 1) + " is not on the start pose");
      }
    }
    ask(picks ? "The arm picks and throws. Is each object at its pick, and everybody out of the way?"
              : "The arm throws. Is everybody out of the way?");
    if (picks && gripper.readOnce().width < kOpenWidth - 2 * kMoved) {
      throw std::runtime_error("the gripper has not opened: see Desk for its state");
    }
    throw_it(robot, gripper, rows, commands, stops);
  } catch (const std::exception& error) {
    std::cerr << error.what() << std::endl;
    return 1;
  }
  return 0;
}
