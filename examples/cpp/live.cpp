// A simulator's loop: makes its own meshes, then for 100 frames moves a car and the sensor, commits, scans at the
// sensor's rate, reads columns without copying them and packs the points as the data of a ROS 2 PointCloud2. Prints how
// many points there were and a digest of them, the same in every language, and the processor time of a frame.
//
//     c++ -std=c++11 live.cpp $(pkg-config --cflags --libs echocast) -o live && ./live
#include <echocast.hpp>

#include <cinttypes>
#include <cstdio>
#include <ctime>

namespace {

constexpr uint32_t frames = 100;
constexpr int houses = 24;

// A box of 12 triangles from (-x, -y, 0) to (x, y, z).
echocast::mesh box(const echocast::context &context, float x, float y, float z,
                   const echocast::material *material = nullptr) {
    std::vector<std::array<float, 3>> corners;
    for (int i = 0; i < 8; ++i) corners.push_back({{i & 1 ? x : -x, i & 2 ? y : -y, i & 4 ? z : 0}});
    const std::vector<std::array<uint32_t, 3>> triangles = {
        {{0, 4, 6}}, {{0, 6, 2}}, {{1, 3, 7}}, {{1, 7, 5}}, {{0, 1, 5}}, {{0, 5, 4}},
        {{2, 6, 7}}, {{2, 7, 3}}, {{0, 2, 3}}, {{0, 3, 1}}, {{4, 5, 7}}, {{4, 7, 6}}};
    return echocast::mesh(context, corners, triangles, material, 1);
}

void place_fixed(echocast::scene &scene, const echocast::mesh &mesh, const echocast_pose &pose, uint32_t category,
                 uint32_t number, const char *name) {
    echocast_instance_desc desc = ECHOCAST_INSTANCE_DESC_INIT;
    desc.mesh = mesh.get();
    desc.pose = pose;
    desc.fixed = 1;
    desc.category_id = category;
    desc.instance_id = number;
    desc.name = name;
    scene.add(desc);
}

// The fields of a sensor_msgs/PointCloud2 with point_step 22.
constexpr std::size_t point_step = 22;
const std::vector<echocast_pack_item> fields = {
    {"x", ECHOCAST_TYPE_F32, 0, 0, 1},          {"y", ECHOCAST_TYPE_F32, 4, 0, 1},
    {"z", ECHOCAST_TYPE_F32, 8, 0, 1},          {"intensity", ECHOCAST_TYPE_F32, 12, 0, 1},
    {"category_id", ECHOCAST_TYPE_U16, 16, 0, 1}, {"instance_id", ECHOCAST_TYPE_U32, 18, 0, 1}};

template <class T>
void add_to_digest(uint64_t &hash, echocast::span<const T> column) {
    const auto *bytes = reinterpret_cast<const unsigned char *>(column.data());
    for (std::size_t k = 0; k < column.size() * sizeof(T); ++k) hash = (hash ^ bytes[k]) * 0x100000001b3;
}

} // namespace

int main() try {
    using echocast::pose_at;
    echocast::context context;
    const echocast::material plaster(context, "{name: plaster, reflectance: 0.5}");
    const echocast::material paint(context, "{name: paint, reflectance: 0.75}");

    echocast::scene scene(context);
    scene.name_label("category", 1, "ground");
    scene.name_label("category", 2, "house");
    scene.name_label("category", 3, "car");
    place_fixed(scene, box(context, 100, 100, 0.25f), pose_at(0, 0, -0.25), 1, 1, "ground");
    const echocast::mesh house = box(context, 4, 4, 6, &plaster);
    for (int i = 0; i < houses; ++i) {
        place_fixed(scene, house, pose_at(10.0 * (i / 2) - 60, i % 2 ? 12 : -12, 0), 2, 2 + static_cast<uint32_t>(i),
                    "house");
    }
    const echocast::instance car = scene.add(box(context, 2, 1, 1.5f, &paint), pose_at(0, 0, 0), 3, 100, "car");

    const echocast::sensor sensor(context, "velodyne_vlp16");
    const int64_t period = sensor.info().period_ns;
    echocast::result points;
    std::vector<uint8_t> message;
    uint64_t hash = 0xcbf29ce484222325;
    std::size_t total = 0;
    std::clock_t start = 0;
    for (uint32_t frame = 0; frame < frames; ++frame) {
        if (frame == 1) start = std::clock(); // the first frame builds what stands
        // The car drives ahead, turned by the angle of the triangle 3, 4, 5; as a quaternion x, y, z, w that is
        // pose_at(8 + 0.25 * frame, 0.0625 * frame - 3, 0, {{0, 0, std::sqrt(0.1), std::sqrt(0.9)}}).
        scene.set_pose(car, {{0.8, -0.6, 0, 8 + 0.25 * frame, 0.6, 0.8, 0, 0.0625 * frame - 3, 0, 0, 1, 0}});

        // The sensor moves during the scan.
        const echocast_pose_key drive[] = {{frame * period, pose_at(0.125 * frame, 0, 1.75)},
                                           {(frame + 1) * period, pose_at(0.125 * (frame + 1), 0, 1.75)}};
        echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
        desc.sensor = sensor.get();
        desc.poses = drive;
        desc.pose_count = 2;
        desc.t0_ns = drive[0].t_ns;
        desc.seed = 7;
        desc.frame = frame;
        desc.columns = "x,y,z,range,intensity,category_id,instance_id,time";
        echocast::scan(scene.commit(), desc, points);

        message.resize(points.size() * point_step); // keeps its memory
        points.pack(fields, point_step, {message.data(), message.size()});

        total += points.size();
        add_to_digest(hash, points.column<float>("range"));
        add_to_digest(hash, points.column<uint32_t>("instance_id"));
    }
    const double milliseconds = 1000.0 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / (frames - 1);
    std::printf("%u frames: %zu points, digest %016" PRIx64 "\n", frames, total, hash);
    std::fprintf(stderr, "%.3f ms of processor time a frame\n", milliseconds);
} catch (const echocast::error &error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 1;
}
