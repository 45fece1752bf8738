/// Ctrl-C while trees are being built: the builds are cancelled, then the signal goes where it would have gone.
#pragma once

#include <array>
#include <atomic>
#include <csignal>
#include <mutex>

#include "build_monitor.h"

/// Cancels `monitor` on SIGINT while it lives; several may, on several threads. When the last one ends, the previous
/// handler is back, and gets a signal that came meanwhile: Python's then raises KeyboardInterrupt as soon as Python
/// code runs again.
class InterruptWatch {
public:
    explicit InterruptWatch(bsp::BuildMonitor &monitor) : m_monitor(monitor) {
        Watches &all = watches();
        const std::lock_guard<std::mutex> lock(all.mutex);
        if (all.count++ == 0)
            start(all);
        for (auto &slot : all.monitors) {
            bsp::BuildMonitor *none = nullptr;
            if (slot.compare_exchange_strong(none, &monitor))
                break; // if all are taken, this build ends by itself
        }
        if (all.interrupted)
            monitor.cancel();
    }

    ~InterruptWatch() {
        Watches &all = watches();
        const std::lock_guard<std::mutex> lock(all.mutex);
        for (auto &slot : all.monitors)
            if (slot == &m_monitor)
                slot = nullptr;
        if (--all.count > 0)
            return;
        sigaction(SIGINT, &all.previous, nullptr);
        if (all.interrupted)
            std::raise(SIGINT);
    }

    InterruptWatch(const InterruptWatch &) = delete;
    InterruptWatch &operator=(const InterruptWatch &) = delete;

private:
    struct Watches {
        std::mutex mutex;
        int count = 0;
        std::array<std::atomic<bsp::BuildMonitor *>, 256> monitors{}; ///< what a signal handler may touch
        std::atomic<bool> interrupted{false};
        struct sigaction previous{};
    };
    static Watches &watches() {
        static Watches all;
        return all;
    }

    static void start(Watches &all) {
        all.interrupted = false;
        struct sigaction action{};
        action.sa_handler = [](int) {
            watches().interrupted = true;
            for (auto &slot : watches().monitors)
                if (bsp::BuildMonitor *const monitor = slot)
                    monitor->cancel();
        };
        sigaction(SIGINT, &action, &all.previous);
    }

    bsp::BuildMonitor &m_monitor;
};
