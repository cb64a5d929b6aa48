// A haptic device under CHAI3D 3 that presses an organ: metres and newtons.
//
//     c++ -std=c++11 chai3d.cpp $(pkg-config --cflags --libs viscera) (CHAI3D's own flags) -o chai3d
//
// CHAI3D's x points to the user, y to the right, z up. The organ lies with its z up and its x to the right; the middle of
// the device's workspace is put on its top.
#include <cstdio>
#include <cstring>
#include <memory>

#include "chai3d.h"
#include "contact.h"
#include "viscera.h"

struct Free {
    void operator()(viscera_model *model) const { viscera_free(model); }
};

struct Scene {
    std::unique_ptr<viscera_model, Free> model;
    chai3d::cGenericHapticDevicePtr device;
    viscera_guard guard;
    volatile bool runs = true, has_ended = false;
};

// The thread that CHAI3D runs as fast as the device answers: no allocation, no lock.
static void haptics(void *argument) {
    Scene &scene = *static_cast<Scene *>(argument);
    chai3d::cVector3d position;
    scene.device->getPosition(position);
    double at[3] = {position.x(), position.y(), position.z()};
    contact tool;
    contact_begin(&tool, at);
    chai3d::cPrecisionClock clock;
    clock.start(true);
    while (scene.runs) {
        scene.device->getPosition(position);
        const double dt = clock.getCurrentTimeSeconds();
        clock.start(true);
        for (int i = 0; i < 3; i++) at[i] = position(i);
        viscera_answer answer;
        double force[3];
        const int32_t status = contact_touch(&tool, scene.model.get(), at, &answer);
        viscera_guard_step_moved(&scene.guard, answer.force, status, tool.moved, dt, force);
        // The force is that of the tool on the organ; the hand feels its negative.
        if (!scene.device->setForce(chai3d::cVector3d(-force[0], -force[1], -force[2]))) scene.runs = false;
    }
    scene.device->setForce(chai3d::cVector3d(0, 0, 0));
    scene.has_ended = true;
}

int main(int argc, char **argv) {
    Scene scene;
    viscera_model *loaded = nullptr;
    char message[256];
    if (argc != 2 || viscera_abi_version() != VISCERA_ABI_VERSION) return 2;
    if (viscera_load_file(argv[1], &loaded, message, sizeof message) != VISCERA_OK) {
        std::fprintf(stderr, "%s\n", message);
        return 2;
    }
    scene.model.reset(loaded);

    const double above[3] = {0, 0, 10};
    viscera_frame frame;
    viscera_frame_identity(&frame);
    viscera_locate(loaded, above, frame.translation, nullptr);
    const double rotation[9] = {0, 1, 0, -1, 0, 0, 0, 0, 1};
    std::memcpy(frame.rotation, rotation, sizeof rotation);
    viscera_set_frame(loaded, &frame);

    chai3d::cHapticDeviceHandler handler;
    if (!handler.getDevice(scene.device, 0) || !scene.device->open()) {
        std::fprintf(stderr, "no haptic device\n");
        return 1;
    }
    scene.device->calibrate();
    const double strongest = scene.device->getSpecifications().m_maxLinearForce;
    viscera_guard_init(&scene.guard, 0.8 * strongest, 2000, 0.02, 0.1);  // N, N/s, s, s
    viscera_guard_keep_passive(&scene.guard, 0.001, 2);                  // J, N s/m

    chai3d::cThread thread;
    thread.start(haptics, chai3d::CTHREAD_PRIORITY_HAPTICS, &scene);
    std::puts("press enter to end");
    std::getchar();
    scene.runs = false;
    while (!scene.has_ended) chai3d::cSleepMs(10);
    scene.device->close();
    return 0;
}
