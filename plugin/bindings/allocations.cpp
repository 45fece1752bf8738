/// The Python extension that builds trees while memory runs out or the user interrupts, to show that nothing is left
/// behind. Everything in it, the C++ library too, takes its memory from failing_allocations.cpp; no other module does.
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>

#include "failing_allocations.h"
#include "tree.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace bindings;

namespace {

/// What the last build took, also if it failed.
struct {
    std::uint64_t allocations = 0, peak_bytes = 0;
} last;

void build_and_discard(const Rows3 &vertices, const Faces &faces, const std::string &tree, const OptionMap &options,
                       const std::string &cache, std::uint64_t fail_at, std::uint64_t interrupt_at,
                       std::uint64_t max_bytes) {
    struct Recorded : failing::Scope {
        using Scope::Scope;
        ~Recorded() { last = {allocations(), peak_bytes()}; }
    };
    const Recorded scope({fail_at, interrupt_at, max_bytes});
    build(vertices, faces, tree, options, "", cache);
}

} // namespace

NB_MODULE(_allocations, m) {
    m.doc() = "Builds of trees in which allocations fail on purpose.";

    m.def("build", &build_and_discard, "vertices"_a, "faces"_a, "tree"_a, "options"_a = OptionMap(), "cache"_a = "",
          "fail_at"_a = 0, "interrupt_at"_a = 0, "max_bytes"_a = 0);
    m.def("allocations", [] { return last.allocations; });
    m.def("peak_bytes", [] { return last.peak_bytes; });
    m.def("live_bytes", &failing::live_bytes);
}
