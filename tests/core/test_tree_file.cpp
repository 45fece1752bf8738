#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "builder.h"
#include "hash.h"
#include "helpers.h"
#include "tree_file.h"

using namespace bsp;
namespace fs = std::filesystem;

namespace {

/// Where the fields of a file are.
constexpr std::size_t byte_order_at = 8, version_at = 12, key_at = 16, nodes_at = 24, references_at = 32,
                      hash_at = 216 + 8 * (depth_limit + 1), header_size = hash_at + 8, node_size = 20;

std::string read_file(const fs::path &path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

void write_file(const fs::path &path, const std::string &bytes) {
    fs::remove(path); // some file systems wait for the disk when a file is overwritten
    std::ofstream(path, std::ios::binary) << bytes;
}

template <typename T> T get(const std::string &bytes, std::size_t at) {
    T value;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

template <typename T> void put(std::string &bytes, std::size_t at, T value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
}

/// Gives a file the hash it would have if it were genuine.
void forge_hash(std::string &bytes) {
    put<std::uint64_t>(bytes, hash_at, 0);
    const std::size_t end_of_nodes = header_size + node_size * get<std::uint64_t>(bytes, nodes_at);
    Hash hash;
    hash.add(bytes.data(), header_size);
    hash.add(bytes.data() + header_size, end_of_nodes - header_size);
    hash.add(bytes.data() + end_of_nodes, bytes.size() - end_of_nodes);
    put(bytes, hash_at, hash.value());
}

void expect_same(const Tree &x, const Tree &y) {
    ASSERT_EQ(x.nodes.size(), y.nodes.size());
    for (std::size_t i = 0; i < x.nodes.size(); ++i) {
        const TreeNode &a = x.nodes[i], &b = y.nodes[i];
        EXPECT_TRUE(a.kind == b.kind && a.direction == b.direction && a.offset == b.offset && a.above == b.above &&
                    a.first == b.first && a.count == b.count)
            << "node " << i;
    }
    EXPECT_EQ(x.references, y.references);
    EXPECT_EQ(x.orientation.turns(), y.orientation.turns());
    EXPECT_EQ(x.orientation.axes(), y.orientation.axes());
    EXPECT_EQ(x.orientation.origin(), y.orientation.origin());
    EXPECT_EQ(x.box.lower, y.box.lower);
    EXPECT_EQ(x.box.upper, y.box.upper);
    EXPECT_EQ(x.sah_cost, y.sah_cost);
    EXPECT_EQ(x.depth, y.depth);
    EXPECT_EQ(x.plane_tolerance, y.plane_tolerance);
    EXPECT_EQ(x.capped_leaves, y.capped_leaves);
    EXPECT_EQ(x.capped_references, y.capped_references);
    ASSERT_EQ(x.levels.size(), y.levels.size());
    for (std::size_t i = 0; i < x.levels.size(); ++i) {
        EXPECT_EQ(x.levels[i].planes, y.levels[i].planes);
        EXPECT_EQ(x.levels[i].references, y.levels[i].references);
    }
}

/// A folder of its own for every test, and a small tree in it.
class TreeFiles : public testing::Test {
protected:
    void SetUp() override {
        fs::remove_all(folder);
        file.save(tree);
        bytes = read_file(file.path());
    }
    void TearDown() override { fs::remove_all(folder); }

    /// Why these bytes are refused, or an empty string.
    std::string complaint(const std::string &changed) const {
        write_file(file.path(), changed);
        try {
            file.load(set);
        } catch (const std::runtime_error &e) {
            return e.what();
        }
        return {};
    }
    std::string forged(const std::function<void(std::string &)> &change) const {
        std::string changed = bytes;
        change(changed);
        forge_hash(changed);
        return complaint(changed);
    }
    std::size_t node_at(std::size_t node, std::size_t field) const { return header_size + node * node_size + field; }
    std::size_t first_leaf() const {
        std::size_t i = 0;
        while (tree.nodes[i].kind != TreeNode::Kind::leaf)
            ++i;
        return i;
    }

    const fs::path folder = fs::path(testing::TempDir()) /
                            (std::string("trees-") + testing::UnitTest::GetInstance()->current_test_info()->name());
    const Settings settings = make_settings("normals", {});
    const TriangleSet set = in_own_units(random_soup(200, 1));
    const Tree tree = build_tree(set, settings);
    const TreeFile file{folder, set, settings};
    std::string bytes;

private:
    /// A set that need not be scaled, so that its file is the one an accelerator looks for.
    static TriangleSet in_own_units(TriangleSet set) {
        set.rescale();
        set.scale = {};
        return set;
    }
};

TEST_F(TreeFiles, ComeBackBitForBit) {
    std::vector<Settings> all{make_settings("kd", {{"orientation", "scene"}})};
    for (const char *name : {"kd", "random", "normals", "clustered"})
        all.push_back(make_settings(name, {}));
    for (const Settings &kept : all)
        for (const std::size_t count : {0u, 1u, 50u, 3000u}) {
            const TriangleSet triangles = random_soup(count, count);
            const Tree built = build_tree(triangles, kept);
            const TreeFile place(folder / "deep" / "er", triangles, kept);
            EXPECT_FALSE(place.load(triangles).has_value());
            place.save(built);
            const std::optional<Tree> loaded = place.load(triangles);
            ASSERT_TRUE(loaded.has_value());
            expect_same(*loaded, built);
            const std::string first = read_file(place.path());
            place.save(*loaded);
            EXPECT_EQ(read_file(place.path()), first);
        }
}

TEST_F(TreeFiles, AreNamedAfterWhatDecidesTheTree) {
    const auto path = [&](const TriangleSet &triangles, const char *name, const Options &options) {
        return TreeFile(folder, triangles, make_settings(name, options)).path();
    };
    EXPECT_EQ(path(set, "normals", {{"triangle_test", "mt"}}), file.path());
    EXPECT_EQ(path(set, "normals", {{"precision", "fast"}}), file.path());
    EXPECT_EQ(path(set, "normals", {{"early_exit", "plane"}}), file.path());
    EXPECT_EQ(file.path().filename().string().substr(0, 8), "normals-");
    EXPECT_NE(path(set, "random", {}), file.path());
    EXPECT_NE(path(set, "normals", {{"seed", "1"}}), file.path());
    EXPECT_NE(path(set, "normals", {{"alpha", "0.10000000000001"}}), file.path());
    for (const float step : {-1.f, 1.f}) {
        TriangleSet moved = set;
        moved.triangles[20].b.y = std::nextafter(moved.triangles[20].b.y, step);
        EXPECT_NE(path(moved, "normals", {}), file.path());
    }
    TriangleSet swapped = set;
    std::swap(swapped.triangles[3], swapped.triangles[4]);
    EXPECT_NE(path(swapped, "normals", {}), file.path());
}

TEST_F(TreeFiles, TruncatedAnywhereAreRefused) {
    for (std::size_t length = 0; length < bytes.size(); ++length)
        EXPECT_NE(complaint(bytes.substr(0, length)), "") << length;
    EXPECT_NE(complaint(bytes + '\0'), "");
    EXPECT_EQ(complaint(bytes), "");
}

TEST_F(TreeFiles, EveryDamagedByteIsSeen) {
    for (std::size_t i = 0; i < bytes.size(); ++i) {
        std::string damaged = bytes;
        damaged[i] = char(damaged[i] ^ 1 << i % 8);
        EXPECT_NE(complaint(damaged), "") << "byte " << i;
    }
}

TEST_F(TreeFiles, ForeignFilesAreNamedAsSuch) {
    EXPECT_NE(complaint(std::string(1000, 'x')).find("another kind"), std::string::npos);
    EXPECT_NE(forged([](auto &b) { put(b, byte_order_at, 0x04030201u); }).find("byte order"), std::string::npos);
    EXPECT_NE(forged([](auto &b) { put(b, version_at, 99u); }).find("format version 99"), std::string::npos);
    EXPECT_NE(forged([](auto &b) { b[key_at] = char(b[key_at] + 1); }).find("other triangles"), std::string::npos);
    fs::remove(file.path());
    fs::create_directory(file.path());
    EXPECT_THROW(file.load(set), std::runtime_error);
}

/// Files with a right hash whose numbers are wild.
TEST_F(TreeFiles, ForgedFilesCannotLeadOutOfTheTree) {
    ASSERT_EQ(forged([](auto &) {}), "");
    const std::size_t leaf = first_leaf(), end_of_nodes = header_size + node_size * tree.nodes.size();
    const auto expect = [&](const char *part, const std::function<void(std::string &)> &change) {
        const std::string said = forged(change);
        EXPECT_NE(said.find(part), std::string::npos) << part << ": " << said;
    };
    for (const std::uint32_t above : {0u, 1u, std::uint32_t(tree.nodes.size()), 0xffffffffu})
        expect("outside the tree", [&](auto &b) { put(b, node_at(0, 16), above); });
    expect("depth-first", [&](auto &b) { put(b, node_at(0, 16), tree.nodes[0].above + 1); });
    expect("leaf", [&](auto &b) { put(b, node_at(leaf, 16), 0xffffffffu); });
    expect("leaves list", [&](auto &b) { put(b, node_at(tree.nodes.size() - 1, 16), 0u); });
    expect("kind", [&](auto &b) { b[node_at(0, 0)] = 3; });
    expect("without a direction", [&](auto &b) { b[node_at(0, 1)] = 3; });
    for (const float slope : {1.5f, -HUGE_VALF, std::nanf("")})
        expect("without a direction", [&](auto &b) { put(b, node_at(0, 4), slope); });
    for (const float offset : {HUGE_VALF, -HUGE_VALF, std::nanf("")})
        expect("not finite", [&](auto &b) { put(b, node_at(0, 12), offset); });
    for (const std::uint32_t id : {std::uint32_t(set.triangles.size()), 0xffffffffu})
        expect("not a valid one", [&](auto &b) { put(b, end_of_nodes, id); });
}

TEST_F(TreeFiles, ForgedSizesAreRefused) {
    for (const std::size_t field : {nodes_at, references_at})
        for (const std::uint64_t count :
             {std::uint64_t(0), std::uint64_t(1) << 32, std::uint64_t(1) << 62, UINT64_MAX}) {
            std::string changed = bytes;
            put(changed, field, count);
            EXPECT_NE(complaint(changed).find("its header says"), std::string::npos) << count;
        }
}

/// Random words in the place of nodes and references: refused, or else as safe as a tree that was built.
TEST_F(TreeFiles, ForgedAtRandomTheyAreRefusedOrSafe) {
    Random random(2);
    const std::vector<Ray> rays = aimed_rays(set, 20, 3);
    int taken = 0;
    for (int round = 0; round < 3000; ++round) {
        std::string changed = bytes;
        const std::uint32_t words = std::uint32_t((bytes.size() - header_size) / 4);
        const std::size_t at = header_size + 4 * random.below(words);
        put(changed, at, round % 2 ? std::uint32_t(random.next()) : random.below(60));
        forge_hash(changed);
        if (!complaint(changed).empty())
            continue;
        ++taken;
        const auto accelerator = make_accelerator(set, settings, {folder.string()});
        EXPECT_TRUE(accelerator->statistics().loaded);
        for (const Ray &ray : rays)
            accelerator->closest(ray);
    }
    EXPECT_GT(taken, 0);
    EXPECT_LT(taken, 3000);
}

TEST_F(TreeFiles, NobodyEverReadsAHalfWrittenFile) {
    const TriangleSet triangles = random_soup(3000, 5);
    const Tree built = build_tree(triangles, settings);
    const TreeFile place(folder, triangles, settings);
    place.save(built);
    const auto write = [&] {
        for (int i = 0; i < 50; ++i)
            place.save(built);
    };
    std::thread one(write), two(write);
    for (int i = 0; i < 100; ++i)
        EXPECT_TRUE(place.load(triangles).has_value());
    one.join();
    two.join();
    EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 2); // nothing temporary stays
}

TEST_F(TreeFiles, MakeAcceleratorKeepsAndRepairs) {
    const auto make = [&](const fs::path &cache) { return make_accelerator(set, settings, {cache.string()}); };
    EXPECT_FALSE(make("")->statistics().loaded);
    EXPECT_TRUE(make(folder)->statistics().loaded);
    write_file(file.path(), bytes.substr(0, 100));
    const auto repaired = make(folder);
    EXPECT_FALSE(repaired->statistics().loaded);
    EXPECT_NE(repaired->statistics().warning.find("built again"), std::string::npos);
    const auto loaded = make(folder), built = make("");
    EXPECT_EQ(loaded->statistics().warning, "");
    ASSERT_TRUE(loaded->statistics().loaded);
    EXPECT_EQ(loaded->statistics().bytes, built->statistics().bytes);
    for (const Ray &ray : aimed_rays(set, 300, 1))
        EXPECT_TRUE(same_bits(loaded->closest(ray), built->closest(ray)));
}

TEST_F(TreeFiles, AFolderThatCannotBeIsAWarning) {
    write_file(folder / "file", "");
    const auto accelerator = make_accelerator(set, settings, {(folder / "file" / "trees").string()});
    EXPECT_FALSE(accelerator->statistics().loaded);
    EXPECT_NE(accelerator->statistics().warning.find("cannot be saved"), std::string::npos);
    EXPECT_EQ(accelerator->statistics().nodes, tree.nodes.size());

    const fs::path unused = folder / "unused";
    make_accelerator(set, make_settings("brute", {}), {unused.string()});
    EXPECT_FALSE(fs::exists(unused));
}

} // namespace
