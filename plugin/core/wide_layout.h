/// The wide node layout: three levels of a binary tree, seven planes and eight cells, in one node that a ray passes in
/// one step. An oblique plane costs no more there than one along the axes.
#pragma once

#include <cstdint>
#include <vector>

#include "accelerator.h"
#include "binary_layout.h"
#include "simd.h"
#include "tree.h"
#include "triangle_block.h"

namespace bsp {

/// What is in a cell of a wide node: nothing, another node, or the blocks of a leaf.
class WideChild {
public:
    static constexpr std::uint32_t max_blocks = 31, max_first = (1u << 26) - 1;

    static WideChild node(std::uint32_t index) { return WideChild(index); }
    static WideChild leaf(std::uint32_t first, std::uint32_t blocks) {
        return WideChild(leaf_bit | blocks << 26 | first);
    }
    WideChild() = default;

    bool is_empty() const { return m_bits == 0; } ///< node 0 is the root, nobody's child
    bool is_leaf() const { return (m_bits & leaf_bit) != 0; }
    std::uint32_t node_index() const { return m_bits; }
    std::uint32_t first_block() const { return m_bits & max_first; }
    std::uint32_t block_count() const { return (m_bits & ~leaf_bit) >> 26; }

private:
    static constexpr std::uint32_t leaf_bit = 1u << 31;
    explicit WideChild(std::uint32_t bits) : m_bits(bits) {}

    std::uint32_t m_bits; ///< not initialised by default, for stacks of them
};

/// Plane i parts the cells of a treelet whose root is plane 0; the planes below and above plane i are 2i + 1 and 2i
/// + 2. Cell c is on the path that bit 2 of c takes at the first level, bit 1 at the second and bit 0 at the third.
struct alignas(32) WideNode {
    static constexpr unsigned planes = 7, cells = 8;

    float normals[3][8]; ///< [axis][plane]; the largest component of each is 1. Lane 7 is not used.
    float offsets[8]; ///< infinite: no plane, everything is below. Not a number: no plane, everything is on both sides.
    WideChild children[cells];
};
static_assert(sizeof(WideNode) == 160);

struct WideLayout {
    Box box;
    std::vector<WideNode> nodes;
    std::vector<TriangleBlock> blocks;
    float plane_tolerance = 0;
    bool has_oblique = false;

    std::vector<MemoryPart> memory() const {
        return {{nodes.data(), nodes.size() * sizeof(WideNode)},
                {blocks.data(), blocks.size() * sizeof(TriangleBlock)}};
    }
};

/// The split planes, in the order of the nodes.
std::vector<Plane> planes_of(const WideLayout &layout);

/// Throws std::length_error if the tree does not fit 26-bit indices of blocks.
WideLayout pack_wide(const Tree &tree, const TriangleSet &set);

} // namespace bsp
