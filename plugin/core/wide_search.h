/// The search through wide nodes, written once and included once for each instruction set: BSP_SIMD names it,
/// BSP_TARGET tells the compiler. Part of wide_traversal.h.

namespace bsp {

template <> struct WideSearch<BSP_SIMD> {
    using Lanes = WideLanes<BSP_SIMD>;

    /// A node takes as long as its chain of dependent instructions, which leaves most of the processor idle. So the
    /// node on top of the stack is passed at the same time, before its turn: its cells wait below those of the other
    /// one.
    template <Mode mode, typename Test, typename Query, typename Counting>
    BSP_TARGET static Query run(const WideLayout &layout, __m128 o, __m128 d, Query query, Counting counting) {
        if constexpr (Counting::counts)
            ++counting.counters.rays;
        const auto [seen_o, seen_d] = layout.orientation.seen(o, d);
        const WideRay<mode> wide(seen_o, seen_d, layout.box, layout.orientation.hit_error(), layout.plane_tolerance);
        if (!(wide.entry <= wide.exit))
            return query;
        const auto test = make_test<Test>(Ray{{o[0], o[1], o[2]}, {d[0], d[1], d[2]}}, query);
        WideStack::Memory memory;
        WideStack stack(memory);
        WideCell cell{layout.root, wide.entry, wide.exit};
        for (;;) {
            if (!cell.child.is_leaf()) {
                const WideCell next = stack.top();
                if (!next.child.is_leaf() && (Query::is_any || next.begin <= query.limit()) &&
                    stack.has_room_for(WideStack::reserve)) {
                    stack.drop();
                    const WideCut cut = pass<Query::is_any>(layout, next, wide, counting);
                    push<mode>(cut, cut.lanes, stack);
                }
                const WideCut cut = pass<Query::is_any>(layout, cell, wide, counting);
                if (cut.lanes != 0) {
                    cell = descend<mode, Query::is_any>(cut, stack);
                    continue;
                }
            } else if (LeafSearch<BSP_SIMD>::template run<mode>(layout.blocks.data() + cell.child.index(),
                                                                cell.child.block_count(), cell.begin, test, query,
                                                                counting)) {
                return query;
            }
            do {
                if (stack.empty())
                    return query;
                cell = stack.top();
                stack.drop();
            } while (!Query::is_any && cell.begin > query.limit());
        }
    }

private:
    template <bool is_any, Mode mode, typename Counting>
    [[gnu::always_inline]] BSP_TARGET static WideCut pass(const WideLayout &layout, const WideCell &cell,
                                                          const WideRay<mode> &ray, Counting counting) {
        const WideLine *const line = layout.lines.data() + cell.child.index();
        const bool is_oblique = cell.child.is_oblique();
        if constexpr (Counting::counts)
            ++(is_oblique ? counting.counters.oblique_steps : counting.counters.axis_steps);
        return Lanes::template cut<!is_any>(line->node, WideMeet::planes(line, is_oblique, ray), cell.begin, cell.end);
    }

    /// Lets the cells in `lanes` wait.
    template <Mode mode>
    [[gnu::always_inline]] BSP_TARGET static void push(const WideCut &cut, unsigned lanes, WideStack &stack) {
        if (mode == Mode::short_stack && !stack.has_room_for(WideStack::size - 8))
            return;
        stack.push(Lanes::together({_mm256_castsi256_ps(cut.children)}, lanes), Lanes::together(cut.begin, lanes),
                   Lanes::together(cut.end, lanes), unsigned(__builtin_popcount(lanes)));
    }

    /// The cell to go on with: the nearest, or for any hit one behind the first plane, if there is one. A shadow ray
    /// starts on a surface, among what it has just missed; where it ends it is more likely to be stopped early. The
    /// others wait; at least one cell must be passed.
    template <Mode mode, bool is_any>
    [[gnu::always_inline]] BSP_TARGET static WideCell descend(const WideCut &cut, WideStack &stack) {
        alignas(32) std::uint32_t children[8];
        alignas(32) float begins[8], ends[8];
        _mm256_store_si256(reinterpret_cast<__m256i *>(children), cut.children);
        _mm256_store_ps(begins, cut.begin.v);
        _mm256_store_ps(ends, cut.end.v);
        const unsigned highest = 31 - unsigned(__builtin_clz(cut.lanes));
        const unsigned chosen = is_any && cut.first_is_downward ? unsigned(__builtin_ctz(cut.lanes)) : highest;
        push<mode>(cut, cut.lanes ^ 1u << chosen, stack);
        return {WideChild(children[chosen]), begins[chosen], ends[chosen]};
    }
};

} // namespace bsp
