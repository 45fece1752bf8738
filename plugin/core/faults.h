/// Trees whose traversal has a mistake on purpose, to show that the tests see it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "accelerator.h"

namespace bsp {

/// Names of all mistakes that can be planted; `Mode` in traversal.h says what each does.
std::vector<std::string> fault_names();

/// A tree built as the settings say and traversed with the mistake, whatever `settings.precision`. Throws
/// std::invalid_argument for an unknown name and for settings.tree == brute.
std::unique_ptr<Accelerator> make_faulty_accelerator(TriangleSet set, const Settings &settings,
                                                     const std::string &fault);

} // namespace bsp
