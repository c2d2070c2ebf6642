// What the C++ wrapper adds to C. argv: a scene with a camera.
#include <echocast.hpp>

#include <cmath>
#include <cstring>
#include <cstdlib>
#include <iostream>

static void require(bool condition, const char *what) {
    if (condition) return;
    std::cerr << what << '\n';
    std::exit(1);
}

static bool close_to(double a, double b) { return std::fabs(a - b) < 1e-5; }

int main(int argc, char **argv) try {
    require(argc == 2, "one argument");
    const echocast::context context(1);

    // A quarter turn to the left: x of the sensor is y of the world.
    const double half = std::sqrt(0.5);
    const echocast_pose turned = echocast::pose_at(1, 2, 3, {{0, 0, half, half}});
    require(close_to(turned.m[0], 0) && close_to(turned.m[4], 1) && close_to(turned.m[1], -1), "turned");
    require(turned.m[3] == 1 && turned.m[7] == 2 && turned.m[11] == 3 && close_to(turned.m[10], 1), "placed");
    try {
        echocast::pose_at(0, 0, 0, {{0, 0, 0, 0}});
        require(false, "a quaternion of length 0");
    } catch (const echocast::error &error) {
        require(error.status() == ECHOCAST_E_ARGUMENT, error.what());
    }

    echocast::scene loaded(context);
    loaded.load(argv[1]);
    const std::vector<echocast::camera> cameras = loaded.cameras();
    require(!cameras.empty(), "no cameras");
    for (const echocast::camera &camera : cameras) {
        const echocast_pose pose = loaded.camera(camera.name);
        for (int i = 0; i < 12; ++i) require(pose.m[i] == camera.pose.m[i], camera.name.c_str());
    }

    // A wall at x = 10 that two rays meet, the second from 4 m nearer and 2 m to the left.
    echocast::scene scene(context);
    scene.name_label("category", 10, "wall");
    const echocast::mesh wall(context, {{{10, -99, -99}}, {{10, 99, -99}}, {{10, 0, 99}}}, {{{0, 1, 2}}});
    scene.add(wall, echocast::pose_at(0, 0, 0), 10, 1);
    require(scene.label_number("category", "wall") == 10, "number in the scene");
    std::vector<echocast_beam> rays(2, echocast_beam());
    for (echocast_beam &ray : rays) ray.direction[0] = 1;
    rays[1].t_ns = 1000;
    rays[1].origin[0] = 4;
    rays[1].origin[1] = 2;
    const echocast::sensor sensor = echocast::sensor::from_rays(context, "pair", rays, 100000000);
    const echocast::result points = echocast::scan(scene.commit(), sensor, echocast::pose_at(0, 0, 0));
    require(points.size() == 2 && points.label_number("category", "wall") == 10, "number in the result");
    const auto range = points.column<float>("range"), y = points.column<float>("y");
    require(close_to(range[0], 10) && close_to(range[1], 6) && close_to(y[0], 0) && close_to(y[1], 2), "ranges");

    // Into memory of our own, with room to spare.
    struct point {
        float x, range;
    };
    std::array<point, 3> mine = {};
    const std::vector<echocast_pack_item> items = {{"x", ECHOCAST_TYPE_F32, 0, 0, 1},
                                                   {"range", ECHOCAST_TYPE_F32, 4, 0, 1}};
    points.pack(items.data(), items.size(), sizeof(point), mine.data(), sizeof mine);
    require(close_to(mine[1].x, 10) && close_to(mine[1].range, 6) && mine[2].x == 0, "packed");
    const echocast_driver_info livox = echocast::driver_info(ECHOCAST_DRIVER_LIVOX);
    require(livox.point_step == 26 && std::string(livox.fields[5].name) == "line", "a driver");
    require(points.pack_driver(ECHOCAST_DRIVER_LIVOX, 0).size() == 52, "points of a driver");
    require(points.driver_shape(ECHOCAST_DRIVER_LIVOX) == std::array<uint32_t, 2>{{1, 2}}, "their shape");
    // Header 4, stamp 8, text 8, numbers 28, and two points.
    const echocast::result line =
        echocast::scan(scene.commit(), echocast::sensor(context, "hokuyo_ust10lx"), echocast::pose_at(0, 0, 0));
    require(line.pack_message(ECHOCAST_MESSAGE_LASER_SCAN, "laser").size() == 8708, "a laser scan");
    const std::vector<uint8_t> bytes = points.pack(items, sizeof(point));
    std::vector<uint8_t> same(bytes.size());
    points.pack(items, sizeof(point), echocast::span<uint8_t>(same.data(), same.size()));
    require(bytes == same, "packed alike");
    try {
        points.pack(items, sizeof(point), echocast::span<uint8_t>(same.data(), same.size() - 1));
        require(false, "too little room");
    } catch (const echocast::error &error) {
        require(error.status() == ECHOCAST_E_ARGUMENT, error.what());
    }
    // Boxes and images, as a camera sees them.
    const echocast::sensor camera = echocast::sensor::from_text(
        context, "{name: eye, kind: tof, pattern: {type: pinhole, resolution: [8, 6], fov_deg: [90, 60]}}");
    const echocast_pose_key here = {0, echocast::pose_at(0, 0, 0)};
    echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
    desc.sensor = camera.get();
    desc.poses = &here;
    desc.pose_count = 1;
    desc.columns = "all";
    desc.boxes = ECHOCAST_BOXES_FRAME;
    echocast::result seen;
    echocast::scan(scene.commit(), desc, seen);
    const echocast::structs<echocast_box> boxes = seen.boxes();
    require(boxes.size() == 1 && !boxes.empty() && boxes[0].instance_id == 1, "a box");
    std::size_t counted = 0;
    for (const echocast_box &box : boxes) counted += box.points;
    require(counted == seen.size() && close_to(boxes.begin()->position[0], 10), "its points");
    require(seen.label_name("category", boxes[0].category_id) == "wall", "its name");
    const echocast::image<const float> depth = seen.image<float>("depth"), normal = seen.image<float>("normal");
    require(depth.width() == 8 && depth.height() == 6 && depth.channels() == 1, "the size of an image");
    require(close_to(depth(4, 3), 10) && depth.row(3)[4] == depth(4, 3) && depth.data() == &depth(0, 0), "a pixel");
    require(normal.channels() == 3 && close_to(normal(4, 3, 2), 1) && close_to(normal(4, 3, 0), 0), "a normal");
    require(seen.image<uint32_t>("category")(4, 3) == 10 && seen.image<uint8_t>("color").channels() == 3, "layers");
    require(seen.image_boxes().size() == 1 && seen.image_boxes()[0].area == seen.size(), "a box in the image");
    require(std::isnan(seen.image_boxes()[0].truncation) && seen.image_boxes()[0].occlusion == 0, "what is hidden");
    try {
        seen.image<float>("category");
        require(false, "numbers as metres");
    } catch (const std::invalid_argument &) {
    }
    try {
        points.boxes();
        require(false, "no boxes");
    } catch (const echocast::error &error) {
        require(error.status() == ECHOCAST_E_ARGUMENT, error.what());
    }

    // Pings: an imaging sonar ahead of a wall in the water.
    echocast::sensor sonar(context, "fls_900");
    sonar.set("pattern.rays", "2000");
    const echocast_pose_key under = {0, echocast::pose_at(0, 0, -20)};
    echocast_scan_desc send = ECHOCAST_SCAN_DESC_INIT;
    send.sensor = sonar.get();
    send.poses = &under;
    send.pose_count = 1;
    send.columns = "intensity,category_id";
    echocast::pings pings, all;
    require(pings.size() == 0, "no pings");
    echocast::ping(scene.commit(), send, pings);
    const echocast_ping_info about = pings.info();
    const echocast::span<const float> levels = pings.levels();
    const std::size_t cells = std::size_t(about.beams) * about.bins;
    require(pings.size() == 1 && about.view == ECHOCAST_SONAR_FAN && levels.size() == cells, "a ping");
    require(pings.axes().size() == 2 * about.beams && pings.threshold_db().size() == about.bins, "its layout");
    require(pings.tvg_db().size() == about.bins && pings.soundings().empty(), "its gain");
    const std::size_t at_wall = about.beams / 2 * about.bins + std::size_t(10 / about.bin_m);
    const auto category = pings.column<uint32_t>("category_id");
    require(category[at_wall] == 10 || category[at_wall + 1] == 10, "the wall in a cell");
    require(pings.label_name("category", 10) == "wall" && pings.label_number("category", "wall") == 10, "its name");
    const std::vector<echocast_pack_item> grey = {{"intensity", ECHOCAST_TYPE_F32, 0, 0, 1}};
    const std::vector<uint8_t> packed = pings.pack(grey, 4);
    float second;
    std::memcpy(&second, packed.data() + 4, 4);
    require(packed.size() == 4 * cells && second == levels[about.bins], "bins by beams");
    echocast_image_place fan_place;
    const echocast::image<const float> fan = pings.image<float>("{view: fan, width: 400}", "values", &fan_place);
    require(fan.width() > 100 && fan.channels() == 1 && fan_place.step[0] > 0, "a fan");
    require(pings.image<uint32_t>("{view: fan, width: 400}", "category_id").height() == fan.height(), "its labels");
    echocast::ping(scene.commit(), send, all);
    all.append(pings);
    require(all.size() == 2 && all.levels(1)[at_wall] == levels[at_wall], "two pings");
    try {
        pings.column<float>("category_id");
        require(false, "numbers as levels");
    } catch (const std::invalid_argument &) {
    }
    const echocast::sensor doppler(context, "ti_awr1843");
    send.sensor = doppler.get();
    send.columns = nullptr;
    echocast::radar frame;
    echocast::result detections;
    echocast::radar_frame(scene.commit(), send, ECHOCAST_RADAR_CUBE | ECHOCAST_RADAR_SAMPLES, frame, detections);
    const echocast_radar_info shape = frame.info();
    require(frame.cube().size() == std::size_t(2) * shape.channels * shape.velocities * shape.ranges, "a cube");
    require(frame.elements().size() == 3 * shape.channels && !frame.samples().empty(), "its elements and samples");
    require(frame.polar_dbm().empty(), "no polar image");
    try {
        echocast::ping(scene.commit(), sensor, echocast::pose_at(0, 0, -20));
        require(false, "a lidar pings");
    } catch (const echocast::error &error) {
        require(error.status() == ECHOCAST_E_ARGUMENT, error.what());
    }
    return 0;
} catch (const std::exception &error) {
    std::cerr << error.what() << '\n';
    return 1;
}
