// A stand-in for CHAI3D 3, for tests only: the few declarations that examples/chai3d.cpp uses, and a scripted device.
#ifndef CHAI3D_STAND_IN_H
#define CHAI3D_STAND_IN_H

#include <memory>

#include "scripted.h"

namespace chai3d {

class cVector3d {
  public:
    explicit cVector3d(double x = 0, double y = 0, double z = 0) : values{x, y, z} {}
    double x() const { return values[0]; }
    double y() const { return values[1]; }
    double z() const { return values[2]; }
    double operator()(unsigned int i) const { return values[i]; }

  private:
    double values[3];
};

struct cHapticDeviceInfo {
    double m_maxLinearForce = 100;
};

class cGenericHapticDevice {
  public:
    bool open() { return true; }
    bool close() {
        scripted_report();
        return true;
    }
    bool calibrate(bool = false) { return true; }
    cHapticDeviceInfo getSpecifications() { return {}; }
    bool getPosition(cVector3d &position) {
        position = cVector3d(0, 0, scripted_height());
        return true;
    }
    bool setForce(const cVector3d &force) {
        const double values[3] = {force.x(), force.y(), force.z()};
        scripted_force(values);
        return scripted_tick <= SCRIPTED_TICKS;
    }
};

typedef std::shared_ptr<cGenericHapticDevice> cGenericHapticDevicePtr;

class cHapticDeviceHandler {
  public:
    bool getDevice(cGenericHapticDevicePtr &device, unsigned int) {
        device = std::make_shared<cGenericHapticDevice>();
        return true;
    }
};

// A millisecond passes between any two questions.
class cPrecisionClock {
  public:
    double start(bool = false) { return 0; }
    double getCurrentTimeSeconds() const { return 0.001; }
};

enum CThreadPriority { CTHREAD_PRIORITY_GRAPHICS, CTHREAD_PRIORITY_HAPTICS };

// Runs at once, to its end.
class cThread {
  public:
    void start(void (*function)(void *), CThreadPriority, void *argument) { function(argument); }
};

inline void cSleepMs(unsigned int) {}

}  // namespace chai3d

#endif
