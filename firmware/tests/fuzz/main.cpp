// Plays the corpus and then mutations of it: `fuzz CORPUS [FRAMES [SEED]]`; the same seed gives the same run. An input
// that breaks a promise is left in `broken`, and is played alone by `fuzz broken`. `fuzz CORPUS seeds` writes the
// seeds.
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

#include "play.h"

extern "C" void __sanitizer_set_death_callback(void (*callback)());

namespace {

namespace files = std::filesystem;
using Items = std::vector<fuzz::Item>;

fuzz::Bytes played;

void keep_input() {
    std::ofstream("broken", std::ios::binary)
        .write(reinterpret_cast<const char*>(played.data()), static_cast<long>(played.size()));
}

void abort_with_input(int) {
    keep_input();
    _Exit(1);
}

fuzz::Bytes read_file(const files::path& path) {
    std::ifstream file(path, std::ios::binary);
    return fuzz::Bytes(std::istreambuf_iterator<char>(file), {});
}

fuzz::Taken taken;

size_t run(const Items& items) {
    played = fuzz::write_items(items);
    const fuzz::Taken now = fuzz::play(items);
    taken.chunks += now.chunks;
    taken.replacements += now.replacements;
    return items.size();
}

std::vector<Items> load(const files::path& place) {
    std::vector<files::path> paths;
    if (files::is_directory(place)) {
        for (const files::directory_entry& entry : files::directory_iterator(place)) paths.push_back(entry.path());
    } else {
        paths.push_back(place);
    }
    std::sort(paths.begin(), paths.end());
    std::vector<Items> all;
    for (const files::path& path : paths) {
        const fuzz::Bytes bytes = read_file(path);
        all.push_back(fuzz::read_items(bytes.data(), bytes.size()));
    }
    return all;
}

void write_seeds(const files::path& folder) {
    size_t number = 0;
    for (const Items& items : fuzz::seeds()) {
        const fuzz::Bytes bytes = fuzz::write_items(items);
        std::ofstream(folder / ("seed_" + std::to_string(number++)), std::ios::binary)
            .write(reinterpret_cast<const char*>(bytes.data()), static_cast<long>(bytes.size()));
    }
}

}  // namespace

int main(int count, char** arguments) {
    if (count < 2) {
        fprintf(stderr, "fuzz CORPUS [FRAMES [SEED]]\n");
        return 2;
    }
    if (count > 2 && strcmp(arguments[2], "seeds") == 0) {
        write_seeds(arguments[1]);
        return 0;
    }
    __sanitizer_set_death_callback(keep_input);
    signal(SIGABRT, abort_with_input);
    const uint64_t wanted = count > 2 ? strtoull(arguments[2], nullptr, 10) : 0;
    std::minstd_rand random(count > 3 ? static_cast<uint32_t>(strtoul(arguments[3], nullptr, 10)) : 1);
    const std::vector<Items> corpus = load(arguments[1]);
    uint64_t frames = 0, inputs = 0;
    for (const Items& items : corpus) frames += run(items), ++inputs;
    // A corpus that moves nothing finds nothing.
    if (corpus.size() > 1 && (taken.chunks < 10 || taken.replacements < 3)) {
        fprintf(stderr, "of the corpus the device takes %llu chunks and %llu replacements: write the seeds anew\n",
                static_cast<unsigned long long>(taken.chunks), static_cast<unsigned long long>(taken.replacements));
        return 1;
    }
    while (frames < wanted && !corpus.empty()) {
        Items items = corpus[random() % corpus.size()];
        fuzz::mutate(items, corpus[random() % corpus.size()], static_cast<uint32_t>(random()));
        frames += run(items);
        ++inputs;
    }
    printf("%llu inputs with %llu items played, %llu chunks and %llu replacements taken, no promise broken\n",
           static_cast<unsigned long long>(inputs), static_cast<unsigned long long>(frames),
           static_cast<unsigned long long>(taken.chunks), static_cast<unsigned long long>(taken.replacements));
    return 0;
}
