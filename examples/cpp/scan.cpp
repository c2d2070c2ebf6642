// Loads the hall, scans it with a Velodyne VLP-16, writes a LAS file, and prints how many points there are and a digest
// of them, the same in every language.
//
//     c++ -std=c++11 scan.cpp $(pkg-config --cflags --libs echocast) -o scan && ./scan ../scenes/indoor-1.glb hall.las
#include <echocast.hpp>

#include <cinttypes>
#include <cstdio>

// 64-bit FNV-1a of the bytes of all columns, one after the other in the order of the table of columns.
static uint64_t digest(const echocast::result &points) {
    uint64_t hash = 0xcbf29ce484222325;
    for (std::size_t i = 0; const char *name = echocast_name("columns", i); ++i) {
        echocast_view column;
        if (echocast_result_view(points.get(), name, &column) != ECHOCAST_OK) continue; // not computed
        const auto *bytes = static_cast<const unsigned char *>(column.data);
        for (std::size_t k = 0; k < column.count * column.stride; ++k) hash = (hash ^ bytes[k]) * 0x100000001b3;
    }
    return hash;
}

int main(int argc, char **argv) try {
    const std::string scene_path = argc > 1 ? argv[1] : "examples/scenes/indoor-1.glb";
    const std::string path = argc > 2 ? argv[2] : "hall.las";

    echocast::context context;
    echocast::scene scene(context);
    scene.load(scene_path);
    echocast::sensor sensor(context, "velodyne_vlp16");
    echocast::result points = echocast::scan(scene.commit(), sensor, echocast::pose_at(-6, 6, 1.2), 7);
    points.write(path);

    std::printf("%s: %zu points, digest %016" PRIx64 "\n", path.c_str(), points.size(), digest(points));
} catch (const echocast::error &error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 1;
}
