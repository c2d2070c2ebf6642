// samples.c in C++: makes all samples of a scenario, one after the other, and writes what is in them.
// argv: a folder for files, the scenario, the threads of the context.
#include <echocast.hpp>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>

static void require(bool condition, const char *what) {
    if (condition) return;
    std::cerr << what << '\n';
    std::exit(1);
}

static void write_columns(const std::string &path, const echocast::result &points) {
    std::ofstream file(path, std::ios::binary);
    for (std::size_t i = 0; const char *name = echocast_name("columns", i); ++i) {
        echocast_view column;
        if (echocast_result_view(points.get(), name, &column) != ECHOCAST_OK) continue; // not computed
        file.write(static_cast<const char *>(column.data), static_cast<std::streamsize>(column.count * column.stride));
    }
    require(file.good(), path.c_str());
}

int main(int argc, char **argv) try {
    require(argc == 4, "three arguments");
    const std::string folder = argv[1];
    const echocast::context context(std::atoi(argv[3]));
    const echocast::scenario scenario(context, argv[2]);
    echocast::result points;
    for (uint64_t number = 0; number < scenario.samples(); ++number) {
        echocast::sample sample = scenario.sample(number);
        const std::string start = folder + "/" + std::to_string(number);
        std::ofstream(start + ".json", std::ios::binary) << sample.drawn();
        for (std::size_t scan = 0; scan < sample.scans(); ++scan) {
            const echocast::sensor sensor = sample.sensor_of(scan);
            for (std::size_t frame = 0; frame < sample.frames(scan); ++frame) {
                sample.scan(scan, frame, points);
                const std::string name = start + "_" + sample.name(scan) + "_" + std::to_string(frame);
                write_columns(name + ".columns", points);
                points.write(name + ".las");
                require(sample.frame(scan, frame).duration_ns > 0, "no duration");
                sample.scan(scan, frame, points, "range");
                const echocast_sensor_info shape = sensor.info();
                const std::size_t beams = std::size_t(shape.rows) * shape.columns;
                require(points.column<float>("range").size() <= beams, "more points than beams");
            }
        }
    }

    const std::string text = "{scene: {files: no.obj}, sensors: [{sensor: velodyne_vlp16}]}";
    echocast::scenario changed = echocast::scenario::from_text(context, text);
    changed.set("samples", "3");
    require(changed.samples() == 3, "not changed");
    try {
        changed.sample(0);
        require(false, "a file that is not there");
    } catch (const echocast::error &error) {
        require(error.status() == ECHOCAST_E_IO, error.what());
    }
    std::puts("passed");
} catch (const echocast::error &error) {
    std::cerr << "error: " << error.what() << '\n';
    return 1;
}
