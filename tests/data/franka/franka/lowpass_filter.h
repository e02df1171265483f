#pragma once

namespace franka {
constexpr double kMaxCutoffFrequency = 1000.0;
}
