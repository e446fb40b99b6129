// A program for the console.
//
//     Program SCENE physics|MODEL FRAMES   prints positions, as examples/rollout.c does
//     Program SCENE mistakes               mistakes, each an exception with its code
//     Program SCENE component              the component, led by two transforms
using System;
using System.Globalization;
using System.Threading;
using UnityEngine;

namespace Selvedge.Tests
{
    public static class Program
    {
        private static int failures;

        public static int Main(string[] words)
        {
            try
            {
                if (words[1] == "mistakes") Mistakes(words[0]);
                else if (words[1] == "component") Component(words[0]);
                else Print(words[0], words[1], int.Parse(words[2]));
            }
            catch (SelvedgeException error)
            {
                Console.Error.WriteLine(error.Status + ": " + error.Message);
                return 1;
            }
            return failures == 0 ? 0 : 1;
        }

        private static void Print(string sceneName, string modelName, int frames)
        {
            using (var stepper = Open(sceneName, modelName))
            {
                var positions = new float[3 * stepper.Counts.Vertices];
                PrintPositions(stepper, positions);
                for (int frame = 0; frame < frames; frame++)
                {
                    int samples = (int)stepper.Counts.Samples;
                    stepper.Step(stepper.MotionTargets(samples), samples);
                    PrintPositions(stepper, positions);
                }
            }
        }

        private static Stepper Open(string sceneName, string modelName)
        {
            using (var scene = new Scene(sceneName))
            {
                if (modelName == "physics") return Stepper.OfPhysics(scene);
                using (var model = new Model(modelName)) return Stepper.OfModel(scene, model);
            }
        }

        private static void PrintPositions(Stepper stepper, float[] positions)
        {
            stepper.CopyPositions(positions);
            // As numbers of the bits: not every runtime writes enough digits.
            for (int k = 0; k < positions.Length; k += 3)
                Console.WriteLine(
                    "{0:x8} {1:x8} {2:x8}", Bits(positions[k]), Bits(positions[k + 1]),
                    Bits(positions[k + 2]));
        }

        private static uint Bits(float number)
        {
            return BitConverter.ToUInt32(BitConverter.GetBytes(number), 0);
        }

        private static void Expect(Status status, Action work, string what)
        {
            Status found = Status.Ok;
            string text = "";
            try
            {
                work();
            }
            catch (SelvedgeException error)
            {
                found = error.Status;
                text = error.Message;
            }
            Console.WriteLine("{0}: {1} {2}", what, found, text);
            if (found != status || (found != Status.Ok && text.Length == 0)) failures++;
        }

        private static void Overflow(Action work)
        {
            try
            {
                work();
            }
            catch (OverflowException)
            {
                return;
            }
            throw new Exception("an array of more numbers than one can have");
        }

        private static void Mistakes(string sceneName)
        {
            Expect(Status.Open, () => new Scene("nowhere/at-all.toml"), "no scene");
            Expect(Status.Open, () => new Model("nowhere/at-all.safetensors"), "no model");
            Expect(Status.Argument, () => new Scene(null), "no name");
            var scene = new Scene(sceneName);
            var model = new Model();
            var stepper = Stepper.OfModel(scene, model);
            Expect(Status.Count, () => stepper.Step(new double[3]), "few targets");
            // 3 numbers for each of 2 handles: as many samples come to 8 in 32 bits.
            Expect(Status.Count, () => stepper.Step(new double[8], 715827884), "many samples");
            Overflow(() => stepper.MotionTargets(715827884));
            Expect(Status.Argument, () => stepper.Step(NotNumbers(stepper)), "not numbers");
            Expect(Status.Count, () => stepper.CopyPositions(new float[3]), "few positions");
            Expect(Status.Ok, stepper.StepAlong, "a step");
            if (stepper.Trust.Frame != 1 || stepper.Frame != 1) failures++;
            stepper.Stop(true);
            Expect(Status.Stopped, stepper.StepAlong, "a step that is to stop");
            stepper.Stop(false);
            Expect(Status.Ok, stepper.StepAlong, "a step that may go on");
            Expect(Status.Stopped, () => Stop(sceneName), "stopped");
            Expect(Status.Stopped, () => Throw(sceneName), "a listener that throws");
            stepper.Dispose();
            Expect(Status.Freed, stepper.StepAlong, "after disposal");
            stepper.Dispose();
            scene.Dispose();
            Expect(Status.Freed, () => Stepper.OfPhysics(scene), "a scene after disposal");
            // What nobody disposes of is freed by its finaliser.
            new Scene(sceneName);
            GC.Collect();
            GC.WaitForPendingFinalizers();
            Console.WriteLine("{0} not as expected", failures);
        }

        private static double[] NotNumbers(Stepper stepper)
        {
            var targets = new double[3 * stepper.Counts.Handles];
            targets[1] = double.NaN;
            return targets;
        }

        private static void Stop(string sceneName)
        {
            using (var scene = new Scene(sceneName))
                Stepper.OfPhysics(scene, (task, done, goal) => done < 2);
        }

        private static void Throw(string sceneName)
        {
            using (var scene = new Scene(sceneName))
                Stepper.OfPhysics(scene, (task, done, goal) => { throw new Exception(task); });
        }

        // Two transforms lead the cloth for two seconds, at 45 frames of the game per second.
        private static void Component(string sceneName)
        {
            var cloth = new SelvedgeCloth { scene = sceneName, transform = new Transform() };
            cloth.transform.position = new Vector3(3, 1, -2);
            cloth.handles = new[] { new Transform(), new Transform() };
            Game.Send(cloth, "OnEnable");
            Time.deltaTime = 1f / 45f;
            for (int wait = 0; cloth.Stepper == null && cloth.enabled && wait < 6000; wait++)
            {
                Thread.Sleep(10);
                Game.Send(cloth, "Update");
            }
            var stepper = cloth.Stepper;
            if (stepper == null) throw new Exception(string.Join("; ", Debug.Errors.ToArray()));
            uint[] held = stepper.Handles();
            float farthest = 0;
            for (int frame = 0; frame < 90; frame++)
            {
                foreach (Transform handle in cloth.handles)
                    handle.position += new Vector3(0.004f, 0.001f, 0.002f);
                ulong last = stepper.Frame;
                Game.Send(cloth, "Update");
                if (stepper.Frame == last) continue;
                Vector3[] shown = cloth.GetComponent<MeshFilter>().sharedMesh.vertices;
                for (int k = 0; k < held.Length; k++)
                {
                    Vector3 there = cloth.transform.TransformPoint(shown[held[k]]);
                    float away = (there - cloth.handles[k].position).magnitude;
                    farthest = Math.Max(farthest, away);
                }
            }
            CheckAxes(stepper, cloth.GetComponent<MeshFilter>().sharedMesh);
            if (farthest > 1e-5f || stepper.Frame < 110 || Debug.Errors.Count > 0) failures++;
            Console.WriteLine(string.Format(
                CultureInfo.InvariantCulture, "{0} frames, handles within {1:e1} m, {2} shown",
                stepper.Frame, farthest, cloth.GetComponent<MeshFilter>().sharedMesh.shown));
            int alive = Mesh.Alive.Count;
            Game.Send(cloth, "OnDisable");
            if (alive != 1 || Mesh.Alive.Count != 0) failures++;
            WrongHandles(sceneName);
        }

        // Unity's axes: z the other way, and the faces with it.
        private static void CheckAxes(Stepper stepper, Mesh mesh)
        {
            var positions = new float[3 * stepper.Counts.Vertices];
            stepper.CopyPositions(positions);
            uint[] faces = stepper.Faces();
            Vector3 vertex = mesh.vertices[5];
            bool same = vertex.x == positions[15] && vertex.y == positions[16];
            if (!same || vertex.z != -positions[17]) failures++;
            bool turned = mesh.triangles[1] == faces[2] && mesh.triangles[2] == faces[1];
            if (!turned || mesh.triangles[0] != faces[0]) failures++;
        }

        // A component with a transform too many says so and is switched off.
        private static void WrongHandles(string sceneName)
        {
            var cloth = new SelvedgeCloth { scene = sceneName, transform = new Transform() };
            cloth.handles = new Transform[3];
            Game.Send(cloth, "OnEnable");
            for (int wait = 0; cloth.enabled && wait < 6000; wait++)
            {
                Thread.Sleep(10);
                Game.Send(cloth, "Update");
            }
            if (cloth.enabled || Debug.Errors.Count != 1) failures++;
            Console.WriteLine(string.Join("; ", Debug.Errors.ToArray()));
        }
    }
}
