/// The shape `bsptree`: meshes and bounded primitives under one of this project's trees.
/// Properties: `tree`, the tree's settings, `count` (rays, steps and tests are counted), `record` (a file that gets
/// every ray and its answer, see ray_recorder.h; they are counted too), `replay` (such a file, whose answers are given
/// again instead of building a tree, see recorded_answers.h), `cache` (a folder in which built trees are kept),
/// `expand` (see bspmember.cpp).
#include <mitsuba/core/progress.h>

#include <chrono>
#include <future>

#include "../interrupt.h"
#include "accelerator.h"
#include "member.h"
#include "ray_counters.h"
#include "ray_recorder.h"
#include "recorded_answers.h"
#include "triangle_test.h"
#include "variants.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class BSPTree final : public Group<Float, Spectrum> {
public:
    MI_IMPORT_BASE(Group, m_children, mesh, extent, child_name, intersect_primitive, rebuild)
    MI_IMPORT_TYPES()
    using typename Base::Hit;

    explicit BSPTree(const Properties &props)
        : Base(props, true), m_settings(read_settings(props)), m_cache(read_folder(props, "cache")),
          m_replay(read_path(props, "replay")), m_recorder(open_recorder(props)),
          m_count(read_flag(props, "count", false) || m_recorder) {
        rebuild();
        m_cache.clear(); // edited geometry is seldom seen again: keeping its trees would only fill the folder
    }

    Hit closest(const Ray3f &ray) const override {
        if (!counts())
            return locate(m_tree->closest(to_ray(ray)), ray);
        bsp::Counters counters;
        const bsp::Hit hit = m_tree->count_closest(to_ray(ray), counters);
        if (m_recorder)
            m_recorder->write_closest(to_ray(ray), hit);
        m_counters.add<false>(counters);
        return locate(hit, ray);
    }

    bool any(const Ray3f &ray) const override {
        if (!counts())
            return m_tree->any(to_ray(ray));
        bsp::Counters counters;
        const bool found = m_tree->count_any(to_ray(ray), counters);
        if (m_recorder)
            m_recorder->write_any(to_ray(ray), found);
        m_counters.add<true>(counters);
        return found;
    }

    Hit intersect(uint32_t child, uint32_t triangle, const Ray3f &ray) const override {
        if (!mesh(child)) {
            Ray3f whole = ray;
            whole.maxt = dr::Infinity<ScalarFloat>;
            return intersect_primitive(child, triangle, whole);
        }
        bsp::Vec3f corners[3];
        this->get_corners(child, triangle, corners);
        const bsp::Triangle t{corners[0], corners[1], corners[2]};
        const auto hit = m_settings.triangle_test == bsp::TriangleTest::woop ? bsp::WoopTest(to_ray(ray)).intersect(t)
                                                                             : bsp::MtTest(to_ray(ray)).intersect(t);
        return hit.found() ? Hit{hit.t(), child, triangle, true, {hit.u(), hit.v()}} : Hit{};
    }

    /// Whoever asks may then read the recorded rays, too.
    std::string statistics() const override {
        if (m_recorder)
            m_recorder->flush();
        std::string text = bsp::to_json(m_tree->statistics());
        if (!m_count)
            return text;
        text.pop_back();
        std::ostringstream oss;
        oss << text << ", \"counters\": " << m_counters << "}";
        return oss.str();
    }

    MI_DECLARE_CLASS(BSPTree)

protected:
    void build() override {
        bsp::TriangleSet set;
        std::vector<uint32_t> starts;
        size_t dropped = 0; // primitives
        auto primitives = std::make_unique<OwnPrimitives>();
        for (size_t i = 0; i < m_children.size(); ++i) {
            starts.push_back(uint32_t(set.triangles.size()));
            if (!mesh(i)) {
                for (uint32_t k = 0; k < m_children[i]->primitive_count(); ++k) {
                    if (const ScalarBoundingBox3f box = m_children[i]->bbox(k); is_finite(box)) {
                        set.add_primitive(padded_primitive(box));
                        primitives->places.push_back({m_children[i].get(), uint32_t(i), k});
                    }
                }
                dropped += extent(i).others;
                continue;
            }
            ShapeIR ir;
            m_children[i]->describe(ir);
            try {
                set.add(static_cast<const float *>(ir.vertex_ptr), ir.vertex_count,
                        static_cast<const uint32_t *>(ir.index_ptr), ir.face_count);
            } catch (const std::exception &e) {
                Throw("child %s: %s", child_name(i), e.what());
            }
        }
        const size_t given = set.triangles.size(), given_primitives = set.primitives.size();
        if (m_replay.empty())
            m_tree = build_tree(std::move(set), primitives.get());
        else
            m_tree = std::make_unique<RecordedAnswers>(m_replay, given, given_primitives);
        m_starts = std::move(starts);
        m_primitives = std::move(primitives);

        const bsp::Statistics &s = m_tree->statistics();
        if (!s.warning.empty())
            Log(Warn, "%s", s.warning);
        if (s.dropped_triangles > 0)
            Log(Warn, "%d of %d triangles have no area or a vertex that is not finite: they are left out",
                s.dropped_triangles, given);
        if (dropped > 0)
            Log(Warn, "%d of %d other primitives have a box that is not finite: they are left out", dropped,
                given_primitives + dropped);
        if (!s.choice.empty())
            Log(Info, "auto: %s", s.choice);
        if (!s.precision.empty())
            Log(Info, "precision: %s", s.precision);
        Log(Info, "bsptree %s: %d triangles and %d other primitives, %d nodes, %d references, %s in %.3f s", s.spec,
            s.triangles, s.primitives, s.nodes, s.references, s.loaded ? "loaded" : "built", s.build_s);
    }

    void clear() override {
        m_tree = bsp::make_accelerator({}, m_settings);
        m_primitives.reset();
    }

    std::string spec() const override { return bsp::full_spec(m_settings); }

private:
    /// The primitives of the children that are no meshes, in order.
    struct OwnPrimitives final : bsp::Primitives {
        struct Place {
            const Shape<Float, Spectrum> *shape;
            uint32_t child, primitive;
        };
        std::vector<Place> places;

        float closest(uint32_t index, const bsp::Ray &ray) const noexcept override {
            const Place &place = places[index];
            const PreliminaryIntersection3f pi =
                place.shape->ray_intersect_preliminary(from_ray(ray), place.primitive, true);
            return pi.is_valid() ? pi.t : std::numeric_limits<float>::infinity();
        }
    };

    static bsp::Settings read_settings(const Properties &props) {
        const std::string tree = props.has_property("tree") ? read_text(props, "tree") : "auto";
        std::vector<std::string> names{"tree", "count", "record", "replay", "cache", "expand"};
        bsp::Options options;
        for (const bsp::SettingHelp &setting : bsp::settings_help(tree)) {
            names.push_back(setting.name);
            if (props.has_property(setting.name))
                options.emplace_back(setting.name, read_text(props, setting.name));
        }
        check_names(props, "a bsptree with tree=" + tree, names);
        return bsp::make_settings(tree, options);
    }

    /// On another thread, so that this one can show how far it is.
    std::unique_ptr<bsp::Accelerator> build_tree(bsp::TriangleSet set, const OwnPrimitives *all) const {
        using namespace std::chrono_literals;
        bsp::BuildMonitor monitor;
        const InterruptWatch watch(monitor);
        const bsp::Primitives *primitives = set.primitives.empty() ? nullptr : all;
        auto building = std::async(std::launch::async, [&] {
            return bsp::make_accelerator(std::move(set), m_settings, {m_cache, &monitor, primitives});
        });
        if (building.wait_for(1s) != std::future_status::ready) {
            ProgressReporter progress("Building the tree");
            while (building.wait_for(100ms) != std::future_status::ready)
                progress.update(float(monitor.progress()));
            progress.update(1.f);
        }
        return building.get();
    }

    bool counts() const { return m_count || CostWatch::is_on(); }

    static std::string read_path(const Properties &props, const std::string &name) {
        return props.has_property(name) ? read_text(props, name) : "";
    }

    static std::unique_ptr<RayRecorder> open_recorder(const Properties &props) {
        const std::string path = read_path(props, "record");
        return path.empty() ? nullptr : std::make_unique<RayRecorder>(path);
    }

    static bsp::Ray to_ray(const Ray3f &ray) {
        return {{ray.o.x(), ray.o.y(), ray.o.z()}, {ray.d.x(), ray.d.y(), ray.d.z()}, ray.maxt};
    }

    static Ray3f from_ray(const bsp::Ray &ray) {
        return Ray3f(Point3f(ray.o.x, ray.o.y, ray.o.z), Vector3f(ray.d.x, ray.d.y, ray.d.z), ray.maxt, 0.f,
                     dr::zeros<Wavelength>());
    }

    /// Which child's triangle or primitive was hit.
    Hit locate(const bsp::Hit &hit, const Ray3f &ray) const {
        if (!hit.found())
            return {};
        if (bsp::is_primitive(hit.triangle)) {
            const auto &place = m_primitives->places[bsp::primitive_index(hit.triangle)];
            const Hit found = intersect_primitive(place.child, place.primitive, ray); // for its prim_uv
            return {hit.t, place.child, place.primitive, true, found.uv};
        }
        const auto next = std::upper_bound(m_starts.begin(), m_starts.end(), hit.triangle);
        const uint32_t child = uint32_t(next - m_starts.begin()) - 1;
        return {hit.t, child, hit.triangle - m_starts[child], true, {hit.u, hit.v}};
    }

    bsp::Settings m_settings;
    std::string m_cache;                     ///< folder of saved trees, empty for none
    std::string m_replay;                    ///< file of recorded answers, empty for answers of a tree
    std::unique_ptr<RayRecorder> m_recorder; ///< of rays, if they are recorded
    bool m_count;
    std::vector<uint32_t> m_starts; ///< first triangle of each child
    std::unique_ptr<OwnPrimitives> m_primitives;
    std::unique_ptr<bsp::Accelerator> m_tree; ///< asks them
    mutable RayCounters m_counters;
};

BSP_EXPORT_PLUGIN(BSPTree)

NAMESPACE_END(mitsuba)
