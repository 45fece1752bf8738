#include "packed_tree.h"

namespace bsp {

template <typename Test>
std::unique_ptr<Accelerator> pack_mixed_tree(const Tree &tree, const TriangleSet &set, const Settings &settings,
                                             Statistics statistics, const Primitives *primitives) {
    return pack_tree<Test, Mode::safe, true>(tree, set, settings, std::move(statistics), primitives);
}

template std::unique_ptr<Accelerator> pack_mixed_tree<WoopTest>(const Tree &, const TriangleSet &, const Settings &,
                                                                Statistics, const Primitives *);
template std::unique_ptr<Accelerator> pack_mixed_tree<MtTest>(const Tree &, const TriangleSet &, const Settings &,
                                                              Statistics, const Primitives *);

} // namespace bsp
