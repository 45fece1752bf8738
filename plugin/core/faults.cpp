#include "faults.h"

#include <stdexcept>

#include "builder.h"
#include "choice.h"
#include "packed_tree.h"

namespace bsp {
namespace {

using Maker = std::unique_ptr<Accelerator> (*)(const Tree &, const TriangleSet &, const Settings &, Statistics,
                                               const Primitives *);

struct NamedFault {
    const char *name;
    Maker make;
};

constexpr NamedFault faults[] = {
    {"first_of_ties", pack_tree<WoopTest, Mode::first_of_ties>},
    {"far_child_dropped", pack_tree<WoopTest, Mode::far_child_dropped>},
    {"wrong_side", pack_tree<WoopTest, Mode::wrong_side>},
    {"signed_zero", pack_tree<WoopTest, Mode::signed_zero>},
    {"small_bound", pack_tree<WoopTest, Mode::small_bound>},
    {"small_moment", pack_tree<WoopTest, Mode::small_moment>},
    {"no_bound", pack_tree<WoopTest, Mode::fast>}, // what `precision=fast` does on purpose
    {"early_out", pack_tree<WoopTest, Mode::early_out>},
    {"short_stack", pack_tree<WoopTest, Mode::short_stack>},
};

} // namespace

std::vector<std::string> fault_names() {
    std::vector<std::string> names;
    for (const NamedFault &fault : faults)
        names.emplace_back(fault.name);
    return names;
}

std::unique_ptr<Accelerator> make_faulty_accelerator(TriangleSet set, const Settings &settings,
                                                     const std::string &name) {
    if (settings.tree == TreeKind::brute)
        throw std::invalid_argument("brute force has no traversal to plant a fault in");
    for (const NamedFault &fault : faults)
        if (name == fault.name) {
            set.rescale();
            const Settings chosen = choose_tree(set, settings).settings;
            return fault.make(build_tree(set, chosen), set, chosen, {}, nullptr);
        }
    std::string known;
    for (const std::string &other : fault_names())
        known += (known.empty() ? "" : ", ") + other;
    throw std::invalid_argument("there is no fault '" + name + "': the faults are " + known);
}

} // namespace bsp
